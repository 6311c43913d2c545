"""What `live_costs` measures beside the bytes of the codec.

engines  what game engines would show of a hand and its tool over the same link
room     many users in one room, by Zenoh on this machine
"""
