"""What results are worth: metrics, norms, orders, verdicts, targets."""
