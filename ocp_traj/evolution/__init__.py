"""What the methods of populations share."""
