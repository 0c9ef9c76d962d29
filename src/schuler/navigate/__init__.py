"""navigate"""
