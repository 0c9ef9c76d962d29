"""Trajectories on maps: KML with time, GPX, GeoJSON; at most five points a second."""

from __future__ import annotations

import datetime
import json
from pathlib import Path

from schuler.io.format import Format, TrackColumns
from schuler.io.trajectories.frames import thinned, utc

_RATE = 5.0


def _moments(track: TrackColumns) -> list[str]:
    start = datetime.datetime.fromtimestamp(0, datetime.UTC)
    stamps = (start + datetime.timedelta(milliseconds=round(t * 1e3)) for t in utc(track["time_s"]))
    return [f"{s:%Y-%m-%dT%H:%M:%S}.{s.microsecond // 1000:03d}Z" for s in stamps]


def _points(track: TrackColumns) -> list[tuple[str, str, str]]:
    return [
        (f"{lon:.9f}", f"{lat:.9f}", f"{h:.3f}")
        for lat, lon, h in zip(
            track["latitude_deg"], track["longitude_deg"], track["height_m"], strict=True
        )
    ]


def write_kml(path: Path, track: TrackColumns) -> None:
    """Write a track with time, which Google Earth plays."""
    thin = thinned(track, _RATE)
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<kml xmlns="http://www.opengis.net/kml/2.2" xmlns:gx="http://www.google.com/kml/ext/2.2">',
        "<Document><name>schuler</name><Placemark><name>trajectory</name>",
        "<gx:Track><altitudeMode>absolute</altitudeMode>",
        *(f"<when>{m}</when>" for m in _moments(thin)),
        *(f"<gx:coord>{' '.join(p)}</gx:coord>" for p in _points(thin)),
        "</gx:Track></Placemark></Document></kml>",
    ]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")


def write_gpx(path: Path, track: TrackColumns) -> None:
    """Write one track with heights and time."""
    thin = thinned(track, _RATE)
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<gpx version="1.1" creator="schuler" xmlns="http://www.topografix.com/GPX/1/1">',
        "<trk><name>trajectory</name><trkseg>",
        *(
            f'<trkpt lat="{lat}" lon="{lon}"><ele>{h}</ele><time>{m}</time></trkpt>'
            for (lon, lat, h), m in zip(_points(thin), _moments(thin), strict=True)
        ),
        "</trkseg></trk></gpx>",
    ]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")


def write_geojson(path: Path, track: TrackColumns) -> None:
    """Write one line with its times as a property."""
    thin = thinned(track, _RATE)
    feature = {
        "type": "Feature",
        "properties": {"name": "trajectory", "times": _moments(thin)},
        "geometry": {
            "type": "LineString",
            "coordinates": [[float(x) for x in p] for p in _points(thin)],
        },
    }
    text = json.dumps({"type": "FeatureCollection", "features": [feature]})
    path.write_text(text + "\n", encoding="utf-8", newline="\n")


FORMATS = (
    Format("kml", "KML with time", (".kml",), write_trajectory=write_kml),
    Format("gpx", "GPX", (".gpx",), write_trajectory=write_gpx),
    Format("geojson", "GeoJSON", (".geojson",), write_trajectory=write_geojson),
)
