//! The planar map: every branch, with its values, in colours to choose.
//!
//! **Input** the embedding, colours by node, tables. **Output** inline SVG with a menu of colours that needs no script,
//! and the values of each branch for the script that shows them under the pointer.
//! **Steps** 1. Lines with the widths of the tubes, a dark rim under all of them. 2. A class for each colour of each
//! colouring; a radio button decides which of them counts. 3. A scale for each colouring, a bar in mm, the root.
//! **Guarantees** at most [`MAX_BRANCHES`] branches have values of their own; what is shorter is drawn together, and a
//! line says so.

use espalier_geom::math;
use espalier_model::Branches;
use maud::{Markup, PreEscaped, html};
use std::fmt::Write as _;

use crate::colorings;
use crate::facts::{Coloring, Facts};
use crate::layout::{Frame, bounds};
use crate::length::{Unit, number};
use crate::losses;
use crate::page::{absent, data_block, png_address};
use crate::space;
use crate::strokes::{self, Budget, Piece, Subject, path};
use crate::worst::{Worst, worst};

/// What the map may cost: some 70 bytes a piece, 7 a point. Two points for each branch of a tree of 50,000 nodes fit.
const BUDGET: Budget = Budget { pieces: 9_000, points: 100_000 };
/// Branches with values of their own: some 80 bytes each.
const MAX_BRANCHES: usize = 8_000;
/// Names in a legend; what is more is counted.
const MAX_NAMES: usize = 24;
/// The share of the width that a scale bar takes at most.
const BAR_SHARE: f64 = 0.2;

pub(crate) fn body(facts: &Facts<'_>) -> Markup {
    let (tree, embedding) = (facts.tree, facts.embedding);
    if tree.n_nodes() < 2 {
        return absent("The tree has a single node: there is nothing to lay flat.");
    }
    let branches = tree.branches();
    let discs = embedding.positions_mm.iter().zip(tree.nodes()).map(|(point, node)| (*point, node.radius_mm));
    let frame = Frame::around(bounds(discs));
    let colorings = colorings::all(facts);
    let bins: Vec<&[u8]> = colorings.iter().map(|coloring| coloring.bins.as_slice()).collect();
    let subject = Subject {
        tree,
        branches: &branches,
        positions_mm: &embedding.positions_mm,
        frame: &frame,
        bins: &bins,
        has_widths: true,
    };
    let pieces = strokes::pieces(&subject, BUDGET);
    let is_own = with_values(facts, &branches);
    let n_own = is_own.iter().filter(|own| **own).count();
    html! {
        p.note {
            "A map, not a projection: it keeps lengths, bends and calibres, not directions. "
            span.with-script { "Drag to move, the wheel with Ctrl or the buttons to zoom; rest on a branch for its values and to see it below in space, click a tip for its calibre below. " }
            @if n_own < is_own.len() {
                "The " (n_own) " longest of " (is_own.len()) " branches have values and colours of their own here; branches.tsv has all."
            }
        }
        style { (PreEscaped(rules(&colorings))) }
        div.colored {
            @for (index, coloring) in colorings.iter().enumerate() {
                input type="radio" name="color" id={ "by-" (coloring.key) } checked[index == 0] {}
                label for={ "by-" (coloring.key) } { (coloring.name) }
            }
            @let found = worst(facts);
            @if !found.is_empty() {
                input type="checkbox" id="show-worst" {}
                label for="show-worst" { "mark where most is lost" }
            }
            @for (index, coloring) in colorings.iter().enumerate() { (scale(index, coloring)) }
            div.canvas {
                svg #map-svg viewBox=(frame.view_box()) role="img" aria-label="the planar map of the tree" {
                    (tubes(&pieces, &is_own))
                    (root_mark(facts, &frame))
                    (bar(&frame))
                    (worst_marks(&found, facts, &frame))
                }
            }
            (space::body(facts, (&branches, &is_own), &colorings))
        }
        @if let Some((png, [width, height])) = facts.space_png.as_ref().and_then(|png| Some((png, size_px(png)?))) {
            figure.print {
                div.strip {
                    svg viewBox={ "0 0 " (width) " " (height) } role="img" aria-label="the organ in space, its centreline and the map, a colour for each branch" {
                        image href=(png_address(png)) width=(width) height=(height) {}
                    }
                }
                figcaption { "The organ in space and on the plane: same colour and same number, same branch." }
            }
        }
        (data_block("map-data", &values(facts, &branches, &is_own)))
    }
}

/// Width and height of a PNG, from its header.
fn size_px(png: &[u8]) -> Option<[u32; 2]> {
    let part = |first: usize| png.get(first..first + 4)?.try_into().ok().map(u32::from_be_bytes);
    Some([part(16)?, part(20)?])
}

/// Which branches have values of their own: the longest.
fn with_values(facts: &Facts<'_>, branches: &Branches) -> Vec<bool> {
    let list = branches.list();
    let lengths: Vec<f64> = list
        .iter()
        .map(|branch| branch.nodes.clone().map(|node| facts.tree.edge_length_mm(node)).sum())
        .collect();
    let mut order: Vec<usize> = (0..list.len()).collect();
    order.sort_by(|&a, &b| lengths[b].total_cmp(&lengths[a]).then(a.cmp(&b)));
    let mut is_own = vec![false; list.len()];
    order.iter().take(MAX_BRANCHES).for_each(|&branch| is_own[branch] = true);
    is_own
}

/// The letter of a colouring in the names of its colours.
pub(crate) fn letter(index: usize) -> char {
    (b'a' + (index % 26) as u8) as char
}

/// Which colour counts when which button is down. Paper is light.
fn rules(colorings: &[Coloring]) -> String {
    let light: String = colorings.iter().enumerate().map(|(i, c)| colors(i, c.key, &c.light)).collect();
    let dark: String = colorings.iter().enumerate().map(|(i, c)| colors(i, c.key, &c.dark)).collect();
    let shown: String =
        colorings.iter().map(|c| format!("#by-{0}:checked~.scale-{0}{{display:block}}", c.key)).collect();
    format!("{light}@media screen and (prefers-color-scheme:dark){{{dark}}}{shown}")
}

/// The colours of one colouring: on the map if it is chosen, on its scale always.
fn colors(index: usize, key: &str, colors: &[[u8; 3]]) -> String {
    let letter = letter(index);
    let rule = |(bin, [r, g, b]): (usize, &[u8; 3])| {
        format!(
            "#by-{key}:checked~.canvas .{letter}{bin},.scale .{letter}{bin}{{--c:#{r:02x}{g:02x}{b:02x}}}"
        )
    };
    colors.iter().enumerate().map(rule).collect()
}

fn scale(index: usize, coloring: &Coloring) -> Markup {
    html! {
        div.scale.(format!("scale-{}", coloring.key)) {
            // Without a caption the colours are those of names.
            @if coloring.caption.is_empty() { (names(index, coloring)) } @else { (bar_of_colors(index, coloring)) }
        }
    }
}

fn names(index: usize, coloring: &Coloring) -> Markup {
    html! {
        ul.legend {
            @if coloring.ticks.is_empty() { li { "a colour for each branch, other than its parent's and its siblings'" } }
            @for (place, name) in coloring.ticks.iter().take(MAX_NAMES) {
                @let bin = (place * coloring.light.len() as f64) as usize;
                li { svg.mark viewBox="0 0 20 20" aria-hidden="true" { rect.(format!("{}{bin}", letter(index))) width="20" height="20" {} } (name) }
            }
            @if coloring.ticks.len() > MAX_NAMES { li { "… and " (coloring.ticks.len() - MAX_NAMES) " more" } }
        }
    }
}

fn bar_of_colors(index: usize, coloring: &Coloring) -> Markup {
    let n_bins = coloring.light.len();
    let step = 1000.0 / n_bins.max(1) as f64;
    html! {
        svg viewBox="-60 0 1120 74" role="img" aria-label=(coloring.caption) {
            @for bin in 0..n_bins {
                rect.(format!("{}{bin}", letter(index))) x=(number(bin as f64 * step, 4)) y="0" width=(number(step + 0.5, 4)) height="26" {}
            }
            @for (place, text) in &coloring.ticks {
                @let x = number(1000.0 * place, 4);
                line x1=(x) x2=(x) y1="26" y2="34" {}
                text x=(x) y="62" text-anchor="middle" { (text) }
            }
        }
        p { (coloring.caption) }
    }
}

/// The branches, thin ones first, the rim under all.
fn tubes(pieces: &[Piece], is_own: &[bool]) -> Markup {
    let mut order: Vec<&Piece> = pieces.iter().filter(|piece| is_own[piece.branch]).collect();
    order.sort_by_key(|piece| piece.width);
    let fine: Vec<Piece> = pieces.iter().filter(|piece| !is_own[piece.branch]).cloned().collect();
    let mut fine_paths: Vec<(i64, String)> = Vec::new();
    for ((width, _), path) in strokes::merged(&fine) {
        match fine_paths.last_mut() {
            Some((last, paths)) if *last == width => paths.push_str(&path),
            _ => fine_paths.push((width, path)),
        }
    }
    let mut out = String::new();
    for (width, path) in fine_paths {
        let _ = write!(out, "<path class=\"fine\" style=\"--w:{width}\" d=\"{path}\"/>");
    }
    order.into_iter().for_each(|piece| write_tube(&mut out, piece));
    html! {
        use.rim href="#tubes" {}
        g #tubes.tubes { (PreEscaped(out)) }
    }
}

/// A piece of a branch as a path that says which branch it is and its class in each colouring.
pub(crate) fn write_tube(out: &mut String, piece: &Piece) {
    let classes = piece.bins.iter().enumerate();
    let classes: Vec<String> = classes.map(|(index, bin)| format!("{}{bin}", letter(index))).collect();
    // Writing to a String cannot fail.
    let _ = write!(
        out,
        "<path class=\"{}\" data-b=\"{}\" style=\"--w:{}\" d=\"{}\"/>",
        classes.join(" "),
        piece.branch,
        piece.width,
        path(&piece.points)
    );
}

fn root_mark(facts: &Facts<'_>, frame: &Frame) -> Markup {
    let [x, y] = frame.place(facts.embedding.positions_mm[0]);
    let radius = frame.units(facts.tree.nodes()[0].radius_mm).max(60.0) + 50.0;
    html! {
        g.root { circle cx=(x) cy=(y) r=(number(radius, 4)) {} text x=(number(x as f64 + radius + 60.0, 6)) y=(y + 70) { "root" } }
    }
}

/// A bar of a round length at the lower left.
fn bar(frame: &Frame) -> Markup {
    let most_mm = BAR_SHARE * frame.size[0] as f64 * frame.mm_per_unit;
    let unit = Unit::fit(most_mm);
    let power = math::pow(10.0, math::floor(math::log10(most_mm / unit.mm)));
    let length = [5.0, 2.0, 1.0].map(|step| step * power).into_iter().find(|l| *l <= most_mm / unit.mm);
    let length_mm = length.unwrap_or(power) * unit.mm;
    let (x, y) = (150.0, frame.size[1] as f64 - 150.0);
    let end = x + frame.units(length_mm);
    html! {
        g.bar {
            path d={ "M" (x) " " (y - 40.0) "v80M" (x) " " (y) "H" (number(end, 6)) "m0 -40v80" } {}
            text x=(x) y=(y - 90.0) { (unit.text(length_mm, 3)) }
        }
    }
}

fn worst_marks(found: &[Worst], facts: &Facts<'_>, frame: &Frame) -> Markup {
    html! {
        g.worst {
            @for worst in found {
                @let [x, y] = frame.place(facts.embedding.positions_mm[worst.node]);
                a href={ "#row-" (worst.id) } {
                    circle id={ "at-" (worst.id) } cx=(x) cy=(y) r="130" {}
                    text x=(x + 150) y=(y - 90) { (worst.id) }
                }
            }
        }
    }
}

/// What the script shows of each branch.
fn values(facts: &Facts<'_>, branches: &Branches, is_own: &[bool]) -> serde_json::Value {
    let (tree, embedding) = (facts.tree, facts.embedding);
    let unit = Unit::of(tree);
    let by_node = [
        losses::angle_deg(tree, embedding),
        losses::length_share(tree, embedding).into_iter().map(|share| 100.0 * share).collect(),
        losses::angle3d_deg(tree, &embedding.positions_mm),
    ];
    let rows =
        branches.list().iter().enumerate().filter(|(index, _)| is_own[*index]).map(|(index, branch)| {
            let cell =
                |column: &str| facts.branches.as_ref().map_or(f64::NAN, |rows| rows.number(index, column));
            let name = facts.branches.as_ref().map_or("", |rows| rows.text(index, "label_name"));
            let most = by_node
                .iter()
                .map(|losses| short(branch.nodes.clone().map(|node| losses[node]).fold(0.0, f64::max)));
            let mut row = vec![
                index.into(),
                branch.generation.into(),
                short(cell("radius_mean_mm") / unit.mm),
                short(cell("length_mm") / unit.mm),
                short(cell("tortuosity")),
            ];
            row.extend(most);
            row.push(if tree.children(branch.end()).is_empty() { 1.into() } else { 0.into() });
            row.push(name.into());
            serde_json::Value::Array(row)
        });
    let names = [
        "branch".to_owned(),
        "generation".to_owned(),
        format!("mean radius ({})", unit.sign),
        format!("length ({})", unit.sign),
        "tortuosity".to_owned(),
        "largest angle loss (°)".to_owned(),
        "largest length loss (%)".to_owned(),
        "largest angle error in space (°)".to_owned(),
        String::new(),
        "label".to_owned(),
    ];
    serde_json::json!({ "names": names, "rows": rows.collect::<Vec<_>>() })
}

/// A number with three digits; nothing where there is none.
fn short(value: f64) -> serde_json::Value {
    /// What is less is rounding.
    const LEAST: f64 = 1e-4;
    if !value.is_finite() {
        return serde_json::Value::Null;
    }
    number(if value.abs() < LEAST { 0.0 } else { value }, 3)
        .parse::<f64>()
        .map_or(serde_json::Value::Null, Into::into)
}
