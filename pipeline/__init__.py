"""Pipeline: sweeps of jobs, references, metrics and the records that reports are made of."""
