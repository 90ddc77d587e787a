"""Cars between walls."""
