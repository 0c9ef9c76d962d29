"""From signals to curves and findings: screening, Allan deviation, confidence."""
