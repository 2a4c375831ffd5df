"""What the numbers may be trusted for: tails of samples, tests between images, intervals, slopes."""
