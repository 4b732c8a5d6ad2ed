"""Where the gap between recording and model lies, which effect causes it, how far it shrinks."""
