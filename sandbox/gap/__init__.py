"""Where a simulator and recordings differ, which effect causes it, and how far the gap shrinks."""
