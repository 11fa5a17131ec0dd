"""What a person sees of a diagnosis: the terminal, one page, one trace."""
