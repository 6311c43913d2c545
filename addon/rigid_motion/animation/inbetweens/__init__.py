"""What happens between keys: computed, written, and kept up to date after every edit.

differences  from sources to differences                channel_values  and back to values of channels
filling      writing those as sampled F-curves          layout      how samples lie in these
live         refreshing after every edit                known_sources   what an edit has changed
insertion    a key inserted in between                  densification   keys inserted all along
mode_keys    choosing modes                             acting      many targets at once
describing   what there is to tell of a segment        on_screen       what is seen, as properties
bodies       channels as poses of a body                glances        which bones an edit was about
concerned    which objects have to do with modes       edit_mode   rigs in Edit Mode
separated    what Separate Slots does to rigs
polls        what is asked of many at every redraw     mending         constraints of bones, put right
outlets      where differences go                      problems       why something does not move as it should
"""
