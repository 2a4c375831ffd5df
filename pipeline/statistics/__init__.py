"""Trust in numbers: tails of samples, tests between images, intervals, slopes."""
