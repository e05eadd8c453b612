"""Examples of answers and queries for the OpenAPI document."""

from typing import Any

from urquhart.report.explanation import REASONS, SKIPS, STOPS

_LINKS = {
    "self": "/v1/collections/plots/submaps/p7",
    "collection": "/v1/collections/plots",
    "tessellation": "/v1/collections/plots/submaps/p7/tessellation",
}
_COUNTS = {
    "landmarks": 92,
    "triangles": 168,
    "polygons": 24,
    "hull_polygons": 17,
    "non_simple_faces": 0,
    "dangling_edges": 3,
}

RECEIPT: dict[str, Any] = {
    "id": "p7",
    "collection": "plots",
    "outcome": "created",
    "counts": _COUNTS,
    "etag": "4be1c0ffee5d5a77",
    "revision": 12,
    "links": _LINKS,
}

SUBMAP_SUMMARY: dict[str, Any] = {
    "id": "p7",
    "collection": "plots",
    "frame_id": "plot_7",
    "stamp": "2026-05-04T09:30:00Z",
    "session": "2026-05-04-robot-2",
    "map_pose": {
        "frame_id": "map",
        "x": 120.5,
        "y": 88.25,
        "yaw": 0.31,
        "covariance": None,
        "covariance_frame": "map",
        "about": "submap_origin",
    },
    "properties": {"observer": "robot-2"},
    "counts": _COUNTS,
    "etag": "4be1c0ffee5d5a77",
    "revision": 12,
    "created": "2026-05-04T09:31:00Z",
    "updated": "2026-05-04T09:31:00Z",
    "links": _LINKS,
}

SUBMAP: dict[str, Any] = SUBMAP_SUMMARY | {
    "landmarks": [{"id": "t1", "x": 1.2, "y": 3.4, "dbh_cm": 31.0}, {"id": "t2", "x": 4.9, "y": -2.2}]
}

TESSELLATION: dict[str, Any] = {
    "submap_id": "p7",
    "fingerprint": "5e2f0c9a41d7",
    "counts": _COUNTS,
    "landmarks": [{"id": "0", "x": 0.0, "y": 0.0}, {"id": "1", "x": 2.0, "y": 0.1}, {"id": "2", "x": 1.1, "y": 1.9}],
    "triangles": [[0, 1, 2]],
    "polygons": [{"vertices": [0, 1, 2], "triangles": [0], "descriptor": [1.2, 0.3]}],
}

_FINDING: dict[str, Any] = {
    "level": "polygons",
    "submap_id": "p7",
    "support": 212,
    "inlier_count": 71,
    "overlap_count": 80,
    "evidence": 95.1,
    "log_odds": 74.8,
    "refused": None,
}

QUERY_ANSWER: dict[str, Any] = {
    "id": "17",
    "collection": "plots",
    "verdict": "matched",
    "reason": "verified",
    "frame_id": "base_link",
    "stamp": "2026-05-05T07:12:03Z",
    "method": "robust",
    "revision": 12,
    "landmark_count": 88,
    "lead": 61.2,
    "warnings": [],
    "gates": {"confidence": 0.998993, "log_odds": 8.7, "lead": 20.6, "lead_per_landmark": 0.25, "lead_ratio": 0.1},
    "candidates": [
        {
            "rank": 1,
            "submap_id": "p7",
            "session": "2026-05-04-robot-2",
            "stamp": "2026-05-04T09:30:00Z",
            "frame_id": "plot_7",
            "transform": {
                "x": 4.21,
                "y": -1.73,
                "yaw": 1.94,
                "covariance": [0.0004, 0.0, 0.0, 0.0, 0.0004, 0.0, 0.0, 0.0, 0.000001],
                "covariance_frame": "submap",
                "about": "query_origin",
                "middle": {
                    "source": [0.0, 0.0],
                    "target": [4.21, -1.73],
                    "covariance": [0.0004, 0.0, 0.0, 0.0, 0.0004, 0.0, 0.0, 0.0, 0.000001],
                    "information": [2500.0, 0.0, 0.0, 0.0, 2500.0, 0.0, 0.0, 0.0, 1000000.0],
                },
            },
            "map_pose": {
                "frame_id": "map",
                "x": 125.05,
                "y": 87.89,
                "yaw": 2.25,
                "covariance": None,
                "covariance_frame": "map",
                "about": "query_origin",
                "middle": None,
            },
            "survey": {
                "frame_id": "map",
                "crs": "EPSG:25832",
                "crs_unit": "metre",
                "metres_per_unit": 1.0,
                "crs_position": [500125.05, 5400087.89],
                "crs_shift": [500125.05, 5400087.89],
                "axes": ["east", "north"],
                "centre": [0.0, 0.0],
                "position": [125.05, 87.89],
                "shift": [125.05, 87.89],
                "turn_degrees": 128.92,
                "turn_positive": "counter_clockwise",
                "covariance": None,
                "covariance_frame": "map",
                "about": "query_centre",
                "shift_sigma": None,
                "turn_sigma_degrees": None,
            },
            "inliers": [
                {"query": "0", "submap": "t17", "residual": 0.11},
                {"query": "1", "submap": "t3", "residual": 0.07},
            ],
            "inlier_count": 71,
            "inlier_ratio": 0.89,
            "rms": 0.14,
            "overlap_ratio": 0.93,
            "support": 212,
            "level": "polygons",
            "evidence": 95.1,
            "log_odds": 74.8,
            "confidence": 1.0,
            "refused": None,
            "warnings": [],
            "links": {
                "submap": "/v1/collections/plots/submaps/p7",
                "match": "/v1/collections/plots/queries/17/candidates/1/match",
            },
        }
    ],
    "rivals": [],
    "search": {
        "stopped_by": "decided",
        "skipped": [],
        "sentence": STOPS["decided"],
    },
    "stages": [{"name": "describe", "milliseconds": 0.8, "counts": {"triangles": 168, "polygons": 24}}],
    "findings": [_FINDING],
    "findings_total": 1,
    "links": {
        "self": "/v1/collections/plots/queries/17",
        "collection": "/v1/collections/plots",
        "explanation": "/v1/collections/plots/queries/17/explanation",
    },
}

EXPLANATION: dict[str, Any] = {
    "query_id": "17",
    "collection": "plots",
    "verdict": "ambiguous",
    "reason": "rival_too_close",
    "lead": 2.4,
    "gates": QUERY_ANSWER["gates"],
    "search": {
        "stopped_by": "exhausted",
        "skipped": ["exhaustive"],
        "sentence": f"{STOPS['exhausted']}; {SKIPS['exhaustive']}",
    },
    "stages": QUERY_ANSWER["stages"],
    "findings": [_FINDING],
    "findings_total": 1,
    "rivals": [
        {
            "submap_id": "p7",
            "transform": {"x": 4.19, "y": 1.27, "yaw": 1.94},
            "evidence": 92.7,
            "inlier_count": 70,
            "links": {"submap": "/v1/collections/plots/submaps/p7"},
        }
    ],
    "sentences": {"rival_too_close": REASONS["rival_too_close"]},
    "links": {
        "self": "/v1/collections/plots/queries/17/explanation",
        "query": "/v1/collections/plots/queries/17",
    },
}

_XY: Any = [[0.4, 2.9], [5.1, -1.7], [-2.6, 1.3], [1.8, -6.0], [-6.2, -3.8], [7.0, 5.9]]
_DBH_CM: Any = [31.0, 22.0, 45.0, 28.0, 19.0, 37.0]
QUERY_INPUTS: Any = [
    {"xy": _XY, "limit": 5},
    {
        "landmarks": [{"x": x, "y": y, "dbh_cm": d} for (x, y), d in zip(_XY, _DBH_CM, strict=True)],
        "explain": True,
    },
    {
        "xy": _XY,
        "stamp": "2026-05-04T10:00:00Z",
        "near": {"x": 120.0, "y": -40.0, "radius": 50.0},
        "exclude": {"session": "monday", "within_seconds": 60.0},
    },
    {
        "xy": _XY,
        "prior": {"x": 412.0, "y": -7.5, "yaw": 0.0, "covariance": [25, 0, 0, 0, 25, 0, 0, 0, 0.002]},
    },
    {"submap_id": "p7", "exclude": {"submap_ids": ["p6", "p8"]}, "store": True, "seed": 1},
]
