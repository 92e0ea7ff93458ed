"""Reads a file of NMEA sentences with pynmea2, which checks their checksums, and prints one line of JSON per
sentence: its type, and its fields as pynmea2 understands them."""

import json
import sys

import pynmea2

FIELDS = {
    "GGA": ["timestamp", "latitude", "longitude", "gps_qual", "num_sats", "horizontal_dil", "altitude", "geo_sep"],
    "RMC": ["timestamp", "status", "latitude", "longitude", "spd_over_grnd", "true_course", "datestamp", "mode_indicator", "nav_status"],
    "GST": ["timestamp", "rms", "std_dev_latitude", "std_dev_longitude", "std_dev_altitude"],
    "GBS": ["timestamp", "lat_err", "lon_err", "alt_err", "sat_prn_num_f", "pro_miss", "est_bias", "est_bias_dev"],
}


def value(message, name):
    got = getattr(message, name, None)
    if got is None or got == "":
        return None
    if name in ("latitude", "longitude") and message.lat == "":
        return None
    if name == "timestamp":
        return (got.hour * 60 + got.minute) * 60 + got.second + got.microsecond / 1e6
    if name == "datestamp":
        return got.isoformat()
    if name in ("status", "mode_indicator", "nav_status"):
        return got
    return float(got)


with open(sys.argv[1], newline="", encoding="ascii") as lines:
    for line in lines:
        message = pynmea2.parse(line, check=True)
        kind = message.sentence_type
        fields = {name: value(message, name) for name in FIELDS[kind]}
        print(json.dumps({"talker": message.talker, "type": kind, **fields}))
