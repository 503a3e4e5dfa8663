"""What a run writes: its folder, time series, frames, checkpoint."""
