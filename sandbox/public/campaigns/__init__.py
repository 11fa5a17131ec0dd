"""What recordings of a bench say: checked, planned, identified, diagnosed, replayed."""
