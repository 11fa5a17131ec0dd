"""The functions of the page `sandbox`, each over what the rooms do, and their results."""
