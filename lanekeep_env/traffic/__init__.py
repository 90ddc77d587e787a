"""Other road users: cars that keep their distance by IDM and change lanes by MOBIL, as highway-env has them."""
