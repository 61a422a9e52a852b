//! The same tree by each method, one over the other at one scale, beside the table of what each loses.
//!
//! **Input** the comparison, or the rows alone. **Output** a picture for each method, coloured by the angle that it loses
//! in space; radio buttons switch them in place. On paper they stand side by side.

use espalier_geom::math;
use espalier_model::table::fixed;
use espalier_model::{Better, CompareColumn, ComparedLayout, Comparison, MethodRow, compare_columns};
use glam::DVec2;
use maud::{Markup, html};

use crate::facts::Facts;
use crate::layout::{Frame, bounds};
use crate::losses::angle3d_deg;
use crate::page::{Head, absent, table};
use crate::strokes::{self, Budget, Subject};
use crate::verdict::degrees;

const BUDGET: Budget = Budget { pieces: 30_000, points: 18_000 };
/// The layouts that are drawn, those of the fewest crossings first; all are in the table.
const MAX_LAYOUTS: usize = 6;
/// Upper ends of the classes of angle errors, degrees.
const CLASSES_DEG: [f64; 4] = [5.0, 15.0, 30.0, 60.0];
/// A loss in the table: its column in `compare.tsv`, its heading, a factor and the decimals.
struct Shown {
    column: &'static str,
    heading: &'static str,
    factor: f64,
    decimals: usize,
}

const fn shown(column: &'static str, heading: &'static str, factor: f64, decimals: usize) -> Shown {
    Shown { column, heading, factor, decimals }
}

const SHOWN: [Shown; 11] = [
    shown("crossings", "crossings", 1.0, 0),
    shown("overlaps", "overlaps", 1.0, 0),
    shown("energy", "energy", 1.0, 2),
    shown("length_loss_mean", "length loss % mean", 100.0, 2),
    shown("length_loss_max", "max", 100.0, 1),
    shown("angle_loss_mean", "angle loss % mean", 100.0, 2),
    shown("angle_loss_max", "max", 100.0, 1),
    shown("angle3d_error_mean_deg", "angle in space ° mean", 1.0, 1),
    shown("angle3d_error_max_deg", "max", 1.0, 1),
    shown("stress", "stress", 1.0, 3),
    shown("spearman", "rank correlation", 1.0, 3),
];

pub(crate) fn body(facts: &Facts<'_>) -> Markup {
    let rows = facts.comparison.map_or_else(
        || facts.embedding.methods.clone(),
        |comparison| comparison.layouts.iter().map(|layout| layout.row.clone()).collect(),
    );
    html! {
        @match facts.comparison.filter(|comparison| comparison.layouts.len() > 1) {
            Some(comparison) => (pictures(facts, comparison)),
            None if rows.len() > 1 => (absent("The layouts of the other methods are not at hand; their losses are.")),
            None => (absent("Only one method ran (embed.methods): there is nothing to compare it with.")),
        }
        @if !rows.is_empty() { (losses(&rows, &facts.embedding.method)) }
    }
}

fn pictures(facts: &Facts<'_>, comparison: &Comparison) -> Markup {
    let mut order: Vec<usize> = (0..comparison.layouts.len()).collect();
    order.sort_by_key(|&index| (index != comparison.chosen, comparison.layouts[index].row.crossings, index));
    order.truncate(MAX_LAYOUTS);
    let boxes: Vec<[DVec2; 2]> = order
        .iter()
        .map(|&index| bounds(comparison.layouts[index].positions_mm.iter().map(|point| (*point, 0.0))))
        .collect();
    let largest = boxes.iter().fold(DVec2::ZERO, |largest, [low, high]| largest.max(*high - *low));
    let rows: Vec<MethodRow> = comparison.layouts.iter().map(|layout| layout.row.clone()).collect();
    html! {
        p.note { "All at one scale; colours say how far each angle is from that in space. " span.with-script { "Flicker switches between this run's layout and the one that was looked at last. " }
            @if facts.tree.branches().list().len() > BUDGET.points / 2 { "Branches too short to be seen at this scale are left out." } }
        div.layouts {
            @for (place, &index) in order.iter().enumerate() {
                input type="radio" name="layout" id={ "layout-" (place) } checked[place == 0] {}
                label for={ "layout-" (place) } { (named(&rows[index], &rows)) }
            }
            div.stack {
                @for (&index, [low, high]) in order.iter().zip(&boxes) {
                    @let center = 0.5 * (*low + *high);
                    (picture(facts, (&comparison.layouts[index], &named(&rows[index], &rows)), &Frame::around([center - 0.5 * largest, center + 0.5 * largest])))
                }
            }
            (legend())
        }
    }
}

fn picture(facts: &Facts<'_>, (layout, name): (&ComparedLayout, &str), frame: &Frame) -> Markup {
    let tree = facts.tree;
    let branches = tree.branches();
    let bins: Vec<u8> = angle3d_deg(tree, &layout.positions_mm).into_iter().map(class).collect();
    let subject = Subject {
        tree,
        branches: &branches,
        positions_mm: &layout.positions_mm,
        frame,
        bins: &[&bins],
        has_widths: true,
    };
    let row = &layout.row;
    html! {
        figure {
            svg viewBox=(frame.view_box()) role="img" aria-label={ "the layout by " (name) } {
                @for ((width, bin), path) in strokes::merged(&strokes::pieces(&subject, BUDGET)) {
                    path.(format!("e{bin}")) style={ "--w:" (width) } d=(path) {}
                }
                @let [x, y] = frame.place(layout.positions_mm[0]);
                circle.root cx=(x) cy=(y) r="110" {}
            }
            figcaption {
                b { (name) } ": " (row.crossings) " crossings, "
                (degrees(row.losses.angle3d_error_mean_deg)) " off in space on average"
            }
        }
    }
}

fn class(error_deg: f64) -> u8 {
    CLASSES_DEG.iter().filter(|&&end| error_deg >= end).count() as u8
}

fn legend() -> Markup {
    let texts = ["under 5°", "5° to 15°", "15° to 30°", "30° to 60°", "60° and more"];
    html! {
        ul.legend {
            @for (bin, text) in texts.iter().enumerate() {
                li { svg.mark viewBox="0 0 20 20" aria-hidden="true" { path.(format!("e{bin}")) style="--w:7" d="M3 10h14" {} } (text) }
            }
        }
    }
}

fn losses(rows: &[MethodRow], own: &str) -> Markup {
    let columns: Vec<CompareColumn> = compare_columns();
    let shown: Vec<(&Shown, &CompareColumn)> = SHOWN
        .iter()
        .filter_map(|shown| Some((shown, columns.iter().find(|column| column.column.name == shown.column)?)))
        .collect();
    let mut heads = vec![Head { name: "method", meaning: "", is_number: false }];
    heads.extend(shown.iter().map(|(shown, column)| Head {
        name: shown.heading,
        meaning: column.column.meaning,
        is_number: true,
    }));
    let best: Vec<Option<f64>> = shown.iter().map(|(shown, column)| best(shown, column, rows)).collect();
    let cells = |row: &MethodRow| -> Vec<Markup> {
        let name = named(row, rows);
        let mut cells = vec![if row.method == own {
            html! { b { (name) } " (this run)" }
        } else {
            html! { (name) }
        }];
        cells.extend(shown.iter().zip(&best).map(|((shown, column), best)| {
            let value = rounded(shown, column, row);
            let text = fixed(value, shown.decimals);
            if Some(value) == *best {
                html! { b { (text) } }
            } else {
                html! { (text) }
            }
        }));
        cells
    };
    let cells: Vec<Vec<Markup>> = rows.iter().map(cells).collect();
    html! {
        (table("sortable losses", &heads, &cells))
        p.note { "The best of each column is bold. A layout with crossings is no planar map, however small its losses. compare.tsv has all losses, dictionary.tsv their meaning." }
    }
}

/// A method's name; with its targets where another row has the same name.
fn named(row: &MethodRow, rows: &[MethodRow]) -> String {
    let is_alone = rows.iter().filter(|other| other.method == row.method).count() == 1;
    if is_alone { row.method.clone() } else { format!("{}, {} targets", row.method, row.targets.name()) }
}

/// The value as the table shows it: what cannot be told apart there is equal.
fn rounded(shown: &Shown, column: &CompareColumn, row: &MethodRow) -> f64 {
    let step = math::pow(10.0, shown.decimals as f64);
    math::floor(column.value(row).unwrap_or(f64::NAN) * shown.factor * step + 0.5) / step
}

/// The best value of a column, where one way is better and rows differ.
fn best(shown: &Shown, column: &CompareColumn, rows: &[MethodRow]) -> Option<f64> {
    let values = || rows.iter().map(|row| rounded(shown, column, row)).filter(|value| value.is_finite());
    let [least, most] = [values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max)];
    match column.better {
        Better::Less if least < most => Some(least),
        Better::More if least < most => Some(most),
        _ => None,
    }
}
