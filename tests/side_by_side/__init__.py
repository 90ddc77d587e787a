"""What drives two checkouts of this repository side by side; nothing that they did is stored."""
