"""What a strategy is worth: `curvature/` tells whether it is holonomic and where its leaves have cusps, `coverage/`
how much of a workspace a leaf serves, `design/` which one serves best, `sheets/` how few serve all, `audit/` how far
any control law or log drifts.

Uses `motion` and `proof`. Read first: `curvature/`, then `audit/`.
"""
