"""`lanekeep tune`: weights of classical controllers and hyper-parameters of learned ones, with equal budgets."""
