//! The tree in space: over the shadow of its mask, with what the ledger says was changed.
//!
//! **Input** the tree, the mask where there is one, the ledger. **Output** three projections side by side with marks by
//! kind, and the ledger as a table.

use espalier_model::{Ledger, LedgerEntry, LedgerKind};
use glam::DVec2;
use maud::{Markup, html};

use crate::Error;
use crate::facts::Facts;
use crate::layout::{Frame, bounds};
use crate::length::{counted, number};
use crate::page::{Head, absent, png_address, table};
use crate::panels::{Plane, world_box};
use crate::shadow::shadow;
use crate::strokes::{self, Budget, Subject};

const BUDGET: Budget = Budget { pieces: 20_000, points: 12_000 };
/// Room for the letters.
const MARGIN: f64 = 0.06;
/// Marks beyond these of one kind are not drawn: they would only cover each other.
const MAX_MARKS: usize = 600;
/// Rows of the ledger on the page.
const MAX_ROWS: usize = 100;
/// The kinds that are marked, with the class of their colour, the sign and what it stands for.
const MARKS: [(LedgerKind, &str, &str); 8] = [
    (LedgerKind::LoopCut, "cut", "loop cut"),
    (LedgerKind::SpurPruned, "spur", "spur pruned"),
    (LedgerKind::TunnelClosed, "tunnel", "tunnel closed"),
    (LedgerKind::ComponentDropped, "island", "island dropped"),
    (LedgerKind::GapBridged, "bridge", "gap bridged"),
    (LedgerKind::RootResolved, "root2", "root resolved"),
    (LedgerKind::RadiusRepaired, "repair", "radius repaired"),
    (LedgerKind::RootChosen, "root", "root"),
];

pub(crate) fn body(facts: &Facts<'_>) -> Result<Markup, Error> {
    let figures = [Plane::Coronal, Plane::Sagittal, Plane::Axial].map(|plane| figure(facts, plane));
    let [coronal, sagittal, axial] = figures;
    Ok(html! {
        p.note { (caption(facts)) }
        div.views { (coronal?) (sagittal?) (axial?) }
        @match facts.ledger {
            Some(ledger) => { (legend(ledger)) (entries(ledger)) },
            None => (absent("This run has no topology ledger: nothing says what was cut or pruned.")),
        }
    })
}

fn caption(facts: &Facts<'_>) -> &'static str {
    match (facts.mask.is_some(), facts.is_of_scan()) {
        (true, _) => {
            "The centreline over the shadow of the mask, darker where the mask is thicker along the line of sight. Marks show where the mask or its skeleton was changed to make a tree."
        }
        (false, true) => {
            "The centreline; the mask is not at hand. Marks show where the skeleton was changed to make a tree."
        }
        (false, false) => {
            "The tree as it was traced: x to the left, z or y up, as the axes of a body would be seen. There is no mask."
        }
    }
}

fn figure(facts: &Facts<'_>, plane: Plane) -> Result<Markup, Error> {
    let tree = facts.tree;
    let positions: Vec<DVec2> = tree.nodes().iter().map(|node| plane.project(node.position_mm)).collect();
    let corners =
        facts.mask.and_then(world_box).into_iter().flatten().map(|corner| (plane.project(corner), 0.0));
    let frame =
        Frame::with_margin(bounds(positions.iter().map(|point| (*point, 0.0)).chain(corners)), MARGIN);
    let branches = tree.branches();
    let bins = vec![0; tree.n_nodes()];
    let subject = Subject {
        tree,
        branches: &branches,
        positions_mm: &positions,
        frame: &frame,
        bins: &[&bins],
        has_widths: false,
    };
    let paths = strokes::merged(&strokes::pieces(&subject, BUDGET));
    let picture = facts.mask.map(|mask| shadow(mask, plane, &frame)).transpose()?;
    let [left, right, top, bottom] = letters(facts, plane);
    let [width, height] = frame.size;
    Ok(html! {
        figure.view {
            svg viewBox=(frame.view_box()) role="img" aria-label={ "the tree, " (plane.name()) } {
                @if let Some(png) = picture {
                    image href=(png_address(&png)) width=(width) height=(height) preserveAspectRatio="none" {}
                }
                g.tree { @for path in paths.values() { path d=(path) {} } }
                @if let Some(ledger) = facts.ledger { (marks(ledger, plane, &frame)) }
                g.letters {
                    text x="120" y=(height / 2) { (left) }
                    text x=(width - 120) y=(height / 2) text-anchor="end" { (right) }
                    text x=(width / 2) y="420" text-anchor="middle" { (top) }
                    text x=(width / 2) y=(height - 120) text-anchor="middle" { (bottom) }
                }
            }
            figcaption { (if facts.is_of_scan() { plane.name() } else { axes_of(plane) }) }
        }
    })
}

/// Letters of the body for a scan, axes for what has no body.
fn letters(facts: &Facts<'_>, plane: Plane) -> [&'static str; 4] {
    match plane {
        _ if facts.is_of_scan() => plane.letters(),
        Plane::Axial => ["+x", "−x", "+y", "−y"],
        Plane::Coronal => ["+x", "−x", "+z", "−z"],
        Plane::Sagittal => ["+y", "−y", "+z", "−z"],
    }
}

fn axes_of(plane: Plane) -> &'static str {
    match plane {
        Plane::Axial => "along z",
        Plane::Coronal => "along y",
        Plane::Sagittal => "along x",
    }
}

fn marks(ledger: &Ledger, plane: Plane, frame: &Frame) -> Markup {
    html! {
        g.marks {
            @for (kind, class, name) in MARKS {
                @for entry in of_kind(ledger, kind).take(MAX_MARKS) {
                    @let [x, y] = frame.place(plane.project(entry.position_mm));
                    @if (0..=frame.size[0]).contains(&x) && (0..=frame.size[1]).contains(&y) {
                        circle.(class) cx=(x) cy=(y) r="90" { title { (name) ": " (entry.reason) } }
                    }
                }
            }
        }
    }
}

fn of_kind(ledger: &Ledger, kind: LedgerKind) -> impl Iterator<Item = &LedgerEntry> {
    ledger.0.iter().filter(move |entry| entry.kind == kind)
}

fn legend(ledger: &Ledger) -> Markup {
    html! {
        ul.legend {
            @for (kind, class, name) in MARKS {
                @let n = ledger.n_of(kind);
                @if n > 0 {
                    li {
                        svg.mark viewBox="0 0 20 20" aria-hidden="true" { circle.(class) cx="10" cy="10" r="6" {} }
                        (name) @if kind != LedgerKind::RootChosen { " (" (n) ")" }
                        @if n > MAX_MARKS { ", the first " (MAX_MARKS) " marked" }
                    }
                }
            }
        }
    }
}

/// How many entries of each kind.
fn kinds(ledger: &Ledger) -> String {
    let mut kinds: Vec<LedgerKind> = ledger.0.iter().map(|entry| entry.kind).collect();
    kinds.sort_unstable();
    kinds.dedup();
    let said: Vec<String> = kinds
        .into_iter()
        .map(|kind| format!("{} {}", ledger.n_of(kind), kind.name().replace('_', " ")))
        .collect();
    if said.is_empty() { String::new() } else { format!(" ({})", said.join(", ")) }
}

fn entries(ledger: &Ledger) -> Markup {
    let head = |name, is_number| Head { name, meaning: "", is_number };
    let heads = [
        head("kind", false),
        head("x mm", true),
        head("y mm", true),
        head("z mm", true),
        head("length mm", true),
        head("why", false),
    ];
    let rows: Vec<Vec<Markup>> = ledger
        .0
        .iter()
        .take(MAX_ROWS)
        .map(|entry| {
            let p = entry.position_mm;
            let mut cells = vec![html! { (entry.kind.name().replace('_', " ")) }];
            cells.extend([p.x, p.y, p.z, entry.length_mm].map(|value| html! { (number(value, 4)) }));
            cells.push(html! { (entry.reason) });
            cells
        })
        .collect();
    html! {
        details {
            summary { "The topology ledger: " (counted(ledger.0.len(), "entry", "entries")) (kinds(ledger)) }
            (table("sortable ledger", &heads, &rows))
            @if ledger.0.len() > MAX_ROWS {
                p.note { "The first " (MAX_ROWS) " of " (ledger.0.len()) "; topology.tsv has all." }
            }
        }
    }
}
