"""From a problem to an NLP, and from a broken limit to the instants that hold it."""
