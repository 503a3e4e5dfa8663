"""Many points at once: what varies, which solver, what is recorded; in parallel, and resumable."""
