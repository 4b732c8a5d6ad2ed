"""FMUs that differ from others in what their model descriptions say."""

import zipfile


def rewritten(path, out, *changes):
    """A copy of an FMU whose model description has other texts: pairs of an old and a new one."""
    with zipfile.ZipFile(path) as source:
        files = {name: source.read(name) for name in source.namelist()}
    text = files["modelDescription.xml"].decode()
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    with zipfile.ZipFile(out, "w") as archive:
        for name, content in (files | {"modelDescription.xml": text.encode()}).items():
            archive.writestr(name, content)
    return out
