"""What every environment is driven by: one control step, one episode, the arrays behind them."""
