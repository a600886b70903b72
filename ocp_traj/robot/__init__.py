"""Robots: kinematics, dynamics in CasADi's SX, joint limits, descriptions from files."""
