"""The real-time host: paced flights with a real or simulated loader, a hand, views and a page.

The frame is that of a batch flight (`coupled fly`). All real-time functions are in the flight's
companion (`host`): pacing, the loader on the network, a stick or the page as the hand, views.
"""
