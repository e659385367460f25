"""docs/league.md."""

from __future__ import annotations


def league_text(found) -> str:
    """For now a table."""
    lines = []
    for p in found:
        lines.append(f"{p.entry.name} {p.versions} pinv {p.pinv_us:.1f} {p.left_out}")
        for s in p.scores:
            lines.append(
                f"  {s.arm:7s} {s.name:36s} {'EX' if s.example else '  '} first {s.first:.1e} later {s.later:.1e} ways {s.ways:.1e} speeds {s.speeds:.1e} "
                f"track {s.tracking:.2g} mm {s.turn:.1e} eff {s.effort:.3f} hurry {s.hurry:.2f} in {s.within} miss {s.missing} us {s.call_us:.1f} first {s.first_seconds:.2f} {s.fault}"
            )
    return "\n".join(lines) + "\n"
