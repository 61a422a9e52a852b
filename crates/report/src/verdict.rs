//! The verdict: what a reader must know before looking at the picture.
//!
//! **Input** the facts. **Output** a line under the heading, and each check in plain words.

use espalier_model::{Certificate, LedgerKind, MethodRow, Termination};
use maud::{Markup, html};

use crate::facts::Facts;
use crate::length::{Unit, counted, number};

/// Energies that differ by less than this share are equal: they are sums of thousands of roundings.
const ENERGY_TOLERANCE: f64 = 1e-9;
/// From here on a loss is worth a look: a length by a tenth, an angle by ten degrees.
const NOTED_LENGTH: f64 = 0.1;
const NOTED_ANGLE_DEG: f64 = 10.0;

/// How a check came out.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Status {
    Good,
    Note,
    Bad,
    Unknown,
}

impl Status {
    fn class(self) -> &'static str {
        match self {
            Self::Good => "good",
            Self::Note => "note",
            Self::Bad => "bad",
            Self::Unknown => "unknown",
        }
    }

    /// A sign for those who do not see colours.
    fn sign(self) -> &'static str {
        match self {
            Self::Good => "✓",
            Self::Note => "!",
            Self::Bad => "✗",
            Self::Unknown => "–",
        }
    }
}

struct Check {
    status: Status,
    what: &'static str,
    found: String,
    meaning: String,
}

/// The line under the heading.
pub(crate) fn lead(facts: &Facts<'_>) -> Markup {
    let (embedding, tree) = (facts.embedding, facts.tree);
    let holds = embedding.certificate.holds();
    let unit = Unit::fit(0.1 * tree.length_mm());
    html! {
        p.verdict.(if holds { "good" } else { "bad" }) {
            @if holds { "✓ No two branches cross in the map: certified." }
            @else { "✗ The map is not planar: " (counted(embedding.certificate.crossings, "pair of edges crosses", "pairs of edges cross")) "." }
        }
        p.size {
            (counted(tree.branches().list().len(), "branch", "branches")) ", "
            (counted(tree.n_tips(), "tip", "tips")) ", "
            (unit.text(tree.length_mm(), 4)) " in all. Length loss "
            (percent(embedding.losses.length_loss_mean)) ", angle error in space "
            (degrees(embedding.losses.angle3d_error_mean_deg)) " on average."
        }
        p.caution { "For research use only." }
    }
}

/// Each check, and all warnings.
pub(crate) fn body(facts: &Facts<'_>) -> Markup {
    let mut checks = vec![crossings(&facts.embedding.certificate), overlaps(facts)];
    checks.extend([lengths(facts), angles(facts), angles_in_space(facts), never_worse(facts)]);
    checks.extend(of_ledger(facts));
    let warnings: Vec<(&str, &(String, String))> = facts
        .stages
        .iter()
        .flat_map(|stage| stage.warnings.iter().map(|warning| (stage.stage.as_str(), warning)))
        .collect();
    checks.push(Check {
        status: if warnings.is_empty() { Status::Good } else { Status::Note },
        what: "Warnings",
        found: warnings.len().to_string(),
        meaning: if warnings.is_empty() { "No stage warned.".into() } else { "See below.".into() },
    });
    html! {
        dl.checks {
            @for check in &checks {
                div.(check.status.class()) {
                    dt { span.sign aria-hidden="true" { (check.status.sign()) } (check.what) }
                    dd { b { (check.found) } " " (check.meaning) }
                }
            }
        }
        @if !warnings.is_empty() {
            h3 { "Warnings" }
            ul.warnings {
                @for (stage, (code, message)) in warnings { li { b { (stage) } ": " (message) " " code { (code) } } }
            }
        }
    }
}

fn crossings(certificate: &Certificate) -> Check {
    let meaning = if certificate.holds() {
        "Certified by exact arithmetic over the coordinates as written, by code apart from the layout's own."
    } else {
        "The map shows forks that are not there: look at the pairs listed in embedding.json."
    };
    Check {
        status: if certificate.holds() { Status::Good } else { Status::Bad },
        what: "Crossings",
        found: certificate.crossings.to_string(),
        meaning: meaning.to_owned(),
    }
}

fn overlaps(facts: &Facts<'_>) -> Check {
    let widths = &facts.embedding.widths;
    let at_least = if widths.is_complete { "" } else { "at least " };
    let meaning = if widths.overlaps == 0 {
        "No two tubes overlap at their true width.".to_owned()
    } else if widths.are_impossible() {
        "pairs of tubes overlap at true width; their area shows that no layout with exact lengths has room for all.".into()
    } else {
        format!(
            "pairs of tubes overlap at true width although their centrelines do not cross; at {} of the width none would.",
            percent(widths.radius_scale)
        )
    };
    let status = if widths.overlaps == 0 { Status::Good } else { Status::Note };
    Check { status, what: "Overlaps", found: format!("{at_least}{}", widths.overlaps), meaning }
}

fn lengths(facts: &Facts<'_>) -> Check {
    let losses = &facts.embedding.losses;
    Check {
        status: noted(losses.length_loss_max > NOTED_LENGTH),
        what: "Length loss",
        found: percent(losses.length_loss_mean),
        meaning: format!(
            "on average of each edge, {} at most, against its length in space.",
            percent(losses.length_loss_max)
        ),
    }
}

fn angles(facts: &Facts<'_>) -> Check {
    let losses = &facts.embedding.losses;
    let is_optimal = facts.embedding.termination == Termination::Optimal;
    let proven = if is_optimal { " Nothing is lost: proven optimal for its targets." } else { "" };
    Check {
        status: noted(losses.angle_loss_max > 0.5),
        what: "Angle loss",
        found: percent(losses.angle_loss_mean),
        meaning: format!(
            "on average against the target angles, {} at most.{proven}",
            percent(losses.angle_loss_max)
        ),
    }
}

fn angles_in_space(facts: &Facts<'_>) -> Check {
    let losses = &facts.embedding.losses;
    Check {
        status: noted(losses.angle3d_error_mean_deg > NOTED_ANGLE_DEG),
        what: "Angle in space",
        found: degrees(losses.angle3d_error_mean_deg),
        meaning: format!(
            "off on average, {} at 95 of 100 nodes or less, {} at most.",
            degrees(losses.angle3d_error_p95_deg),
            degrees(losses.angle3d_error_max_deg)
        ),
    }
}

fn never_worse(facts: &Facts<'_>) -> Check {
    let embedding = facts.embedding;
    let own = embedding.energy.total();
    let others: Vec<&MethodRow> =
        embedding.methods.iter().filter(|row| row.method != embedding.method && row.crossings == 0).collect();
    let what = "Never worse";
    let Some(best) = others.iter().min_by(|a, b| a.energy.total().total_cmp(&b.energy.total())) else {
        let meaning =
            "No other method of this run has a layout without crossings to compare with.".to_owned();
        return Check { status: Status::Unknown, what, found: "no comparison".to_owned(), meaning };
    };
    let is_better = own <= best.energy.total() * (1.0 + ENERGY_TOLERANCE) + ENERGY_TOLERANCE;
    let compared = format!(
        "energy {} ({}), the best of the {} {} ({})",
        number(own, 4),
        embedding.method,
        counted(others.len(), "other", "others"),
        number(best.energy.total(), 4),
        best.method
    );
    if is_better {
        return Check { status: Status::Good, what, found: "holds".into(), meaning: format!("{compared}.") };
    }
    let meaning = format!("{compared}: a method was asked for by name, or room at true width came first.");
    Check { status: Status::Note, what, found: "does not hold".to_owned(), meaning }
}

fn of_ledger(facts: &Facts<'_>) -> Vec<Check> {
    let Some(ledger) = facts.ledger else {
        let meaning = "This run has no topology ledger.".to_owned();
        return vec![Check { status: Status::Unknown, what: "Topology", found: "unknown".into(), meaning }];
    };
    let kinds = [
        (LedgerKind::LoopCut, "Loops cut", "where branches met in a ring, by removing one edge each."),
        (
            LedgerKind::SpurPruned,
            "Spurs pruned",
            "too short against the calibre they hang from: noise of the surface.",
        ),
        (
            LedgerKind::TunnelClosed,
            "Tunnels closed",
            "faults of the mask, mended by a few voxels each before thinning.",
        ),
        (LedgerKind::ComponentDropped, "Islands dropped", "apart from the tree in the mask."),
        (LedgerKind::GapBridged, "Gaps bridged", "from the tree to what was apart, by a straight edge each."),
        (LedgerKind::RadiusRepaired, "Radii repaired", "where they were missing or impossible."),
        (LedgerKind::RootResolved, "Roots resolved", "beyond the first, dropped or joined."),
    ];
    let always = if facts.is_of_scan() { 4 } else { 0 };
    let shown = kinds.into_iter().enumerate().map(|(i, kind)| (i < always, kind));
    shown
        .filter_map(|(is_always, (kind, what, meaning))| {
            let n = ledger.n_of(kind);
            (is_always || n > 0).then(|| Check {
                status: if n == 0 { Status::Good } else { Status::Note },
                what,
                found: n.to_string(),
                meaning: if n == 0 { "none.".to_owned() } else { meaning.to_owned() },
            })
        })
        .collect()
}

fn noted(is_noted: bool) -> Status {
    if is_noted { Status::Note } else { Status::Good }
}

/// A share as a percentage.
pub(crate) fn percent(share: f64) -> String {
    match 100.0 * share {
        percent if !percent.is_finite() => "unknown".to_owned(),
        percent if percent > 0.0 && percent < 0.005 => "under 0.01 %".to_owned(),
        percent => format!("{} %", number(percent, 3)),
    }
}

/// Degrees with a decimal; `0°` only where nothing is off.
pub(crate) fn degrees(angle_deg: f64) -> String {
    match angle_deg {
        angle if !angle.is_finite() => "unknown".to_owned(),
        angle if angle > 0.0 && angle < 0.05 => "under 0.1°".to_owned(),
        angle => format!("{angle:.1}°"),
    }
}
