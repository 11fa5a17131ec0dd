"""The check on withheld effects: how often the diagnosis finds what is wrong with a drive that it
has never seen."""
