"""What a person sees of comparisons, protocols and maps: pages, figures, traces, tables of
texts."""
