"""Comparisons of live streaming for `live_costs`: packed poses, game engines on a bad link, and a crowded room."""
