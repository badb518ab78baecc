"""What was measured: channels in memory and the cleaning of raw rows. No I/O."""
