"""From a column mapping and a CSV of measurements to a recording: :func:`.importer.import_recording`."""
