"""Motors from ordinary recordings: R, inductances and magnet flux by least squares on replays of
any commands."""
