"""Structures that the search tries, as in our files of candidates (`annexes/search/families/`)."""

FAMILY = {
    "kind": "washouts",
    "timed": True,  # for recordings at even steps
    "fit": {"scaling": "range", "ridge": 0.002, "tolerance": 0},
    "candidates": [
        {
            "words": "washouts",
            "when": {"inputs": 5, "moving": 1},
            "dictionary": [
                {
                    "products": {
                        "of": ["INPUTS", {"washout": {"of": "MOVING", "tau": [0.5, 2]}}],
                        "order": 1,
                        "constant": False,
                    }
                }
            ],
            "fit": {"max_terms": 8},
        }
    ],
}
