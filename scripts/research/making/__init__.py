"""How the assets are made: motions as people move, the device that records them, and the models as meshes."""
