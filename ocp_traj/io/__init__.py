"""Files: limits, run folders, exports, pictures."""
