"""The real-time host: a flight as `coupled fly` flies it, paced, with what attaches to it.

The frame is the batch flight's own. What is live comes along as its companion: pacing, the loader
at the other end of a wire, a hand on a stick or on the page, the views, and the page.
"""
