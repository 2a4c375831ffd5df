"""The plan: which effects a scene calls for, why, and which provably contribute nothing."""
