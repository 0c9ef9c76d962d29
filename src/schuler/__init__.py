"""schuler"""
