"""One file per change of the tables; none of them is ever altered once released."""
