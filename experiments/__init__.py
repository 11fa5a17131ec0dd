"""One short script per question; each writes a figure and a JSON of its numbers under results/."""
