"""The local page: from a file of measurements to parameters, a forecast and a diagnosis, in a browser.

:mod:`.project` holds what was chosen and made, as files in a folder, and knows no browser; :mod:`.job` runs the long
steps in a child process; :mod:`.page` draws; :mod:`.server` lets the browser of this machine in, and nobody else.
"""
