"""The written USD against the photos it came from: measures, gates, report."""
