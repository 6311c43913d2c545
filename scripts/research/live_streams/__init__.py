"""What `live_costs` measures beside the codec: packed poses, game engines on a bad link, and a room of many."""
