"""What people and scripts get: result folders, tables, figures, traces."""
