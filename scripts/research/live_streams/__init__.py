"""What `live_costs` measures beside the bytes of the codec: game engines on a bad link, and a room of many."""
