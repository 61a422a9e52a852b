//! The input: what it is, where it lies, and slices of it with the mask's outline.
//!
//! **Guarantees** of files only their size and digest, of headers only geometry, of the scan only values.

use espalier_model::Mask;
use maud::{Markup, html};

use crate::Error;
use crate::facts::{Facts, InputKind};
use crate::length::{grouped, number};
use crate::outline::outline;
use crate::page::{absent, png_address};
use crate::panels::{Strip, strips};

pub(crate) fn body(facts: &Facts<'_>) -> Result<Markup, Error> {
    Ok(html! {
        (description(facts))
        @match facts.mask.and_then(|mask| Some((mask, strips(mask)?))) {
            Some((mask, strips)) => (mosaic(facts, mask, &strips)),
            None => (absent(no_slices(facts))),
        }
    })
}

fn no_slices(facts: &Facts<'_>) -> &'static str {
    match facts.input_kind {
        InputKind::Tree | InputKind::PhantomTree => {
            "The run began with a traced tree: there is no scan and no mask to show slices of."
        }
        _ => "The mask of this run is not at hand: there are no slices to show.",
    }
}

fn description(facts: &Facts<'_>) -> Markup {
    let mut rows: Vec<(&str, String)> = vec![("Kind", kind(facts))];
    let volume = |name: &str| facts.count("volume", name);
    if let Some(mask) = facts.mask {
        let grid = mask.grid();
        let join = |numbers: [f64; 3]| numbers.map(|value| number(value, 4)).join(" × ");
        if let (Some(x), Some(y), Some(z)) = (volume("shape_x"), volume("shape_y"), volume("shape_z"))
            && [x, y, z] != grid.shape().map(|extent| extent as f64)
        {
            rows.push(("Shape as stored", format!("{} voxels", join([x, y, z]))));
        }
        rows.push(("Shape", format!("{} voxels", grid.shape().map(|extent| extent.to_string()).join(" × "))));
        rows.push(("Spacing", format!("{} mm", join(grid.spacing_mm().to_array()))));
        rows.push(("Axes of the mask", orientation(&grid.orientation())));
        let n_foreground = mask.n_foreground();
        let millilitres = n_foreground as f64 * grid.voxel_volume_mm3() / 1000.0;
        rows.push(("Mask", format!("{} voxels, {} ml", grouped(n_foreground), number(millilitres, 3))));
    } else {
        rows.push(("Nodes", grouped(facts.tree.n_nodes())));
    }
    if let Some(slices) = &facts.slices {
        let [[least, most], [black, white]] =
            [slices.range, slices.window].map(|ends| ends.map(|v| number(v, 4)));
        rows.push((
            "Intensities",
            format!("{least} to {most}; shown from {black} (black) to {white} (white)"),
        ));
    }
    html! {
        dl.facts { @for (name, value) in rows { div { dt { (name) } dd { (value) } } } }
    }
}

fn kind(facts: &Facts<'_>) -> String {
    let made =
        match (facts.setting("volume.preset"), facts.setting("volume.label"), facts.setting("volume.method"))
        {
            (Some(preset), _, _) => format!(", preset {preset}"),
            (_, Some(label), _) => format!(", label {label}"),
            (_, _, Some(method)) if method != "auto" => format!(", mask by {method}"),
            _ => String::new(),
        };
    match facts.input_kind {
        InputKind::Tree => "traced tree".to_owned(),
        InputKind::PhantomTree => "phantom, traced".to_owned(),
        InputKind::PhantomScan => format!("phantom scan{made}"),
        InputKind::Volume if facts.slices.is_some() => format!("scan{made}"),
        InputKind::Volume => format!("mask or label map{made}"),
    }
}

/// `LPS: x towards left, y towards posterior, z towards superior`.
fn orientation(letters: &str) -> String {
    let word = |letter: char| match letter {
        'R' => "right",
        'L' => "left",
        'A' => "anterior",
        'P' => "posterior",
        'S' => "superior",
        _ => "inferior",
    };
    let axes = letters.chars().zip(["x", "y", "z"]);
    let towards: Vec<String> = axes.map(|(letter, axis)| format!("{axis} to {}", word(letter))).collect();
    format!("{letters} ({})", towards.join(", "))
}

fn mosaic(facts: &Facts<'_>, mask: &Mask, strips: &[Strip; 3]) -> Markup {
    let widest = strips.iter().map(|strip| strip.total_px()[0]).max().unwrap_or(1);
    html! {
        p.note {
            "Slices through the mask, its outline in orange"
            @if facts.slices.is_none() { "; the grey values of a scan are not part of this run" }
            ". Axial slices are seen from the feet, coronal ones from the front: the patient's right is on the left."
        }
        div.strips {
            @for (index, strip) in strips.iter().enumerate() {
                (drawn(mask, (strip, widest), facts.slices.as_ref().map(|slices| slices.png[index].as_slice())))
            }
        }
    }
}

fn drawn(mask: &Mask, (strip, widest): (&Strip, usize), png: Option<&[u8]>) -> Markup {
    let [width, height] = strip.total_px();
    let [panel_px, _] = strip.size_px;
    let outlines: Vec<String> = (0..strip.at_mm.len())
        .map(|panel| outline(strip.size_px, &inside(mask, strip, panel), (panel * panel_px) as i64))
        .collect();
    let [left, right, top, bottom] = strip.plane.letters();
    let middle = height / 2;
    html! {
        figure.strip {
            svg viewBox={ "0 0 " (width) " " (height) } role="img" style={ "--part:" (number(width as f64 / widest as f64, 4)) }
                aria-label={ (strip.plane.name()) " slices with the outline of the mask" } {
                @match png {
                    Some(png) => image href=(png_address(png)) width=(width) height=(height) {},
                    None => rect width=(width) height=(height) class="empty" {},
                }
                @for (panel, outline) in outlines.iter().enumerate() {
                    path class=(if png.is_some() { "contour" } else { "contour filled" }) d=(outline) {}
                    @let x = panel * panel_px;
                    text x=(x + 4) y=(middle) { (left) }
                    text x=(x + panel_px - 4) y=(middle) text-anchor="end" { (right) }
                    text x=(x + panel_px / 2) y="13" text-anchor="middle" { (top) }
                    text x=(x + panel_px / 2) y=(height - 4) text-anchor="middle" { (bottom) }
                }
            }
            figcaption {
                (strip.plane.name()) " at "
                (strip.at_mm.iter().map(|at| number(*at, 4)).collect::<Vec<_>>().join(", ")) " mm"
            }
        }
    }
}

/// Which pixels of a panel are in the mask.
fn inside(mask: &Mask, strip: &Strip, panel: usize) -> Vec<bool> {
    let grid = mask.grid();
    let voxel_from_world = grid.voxel_from_world();
    let [width, height] = strip.size_px;
    let is_inside = |column: usize, row: usize| {
        let point = voxel_from_world.transform_point3(strip.point_mm(panel, [column, row]));
        grid.voxel_at(point).is_some_and(|voxel| mask.bits().get(voxel))
    };
    (0..height)
        .flat_map(|row| (0..width).map(move |column| (column, row)))
        .map(|(c, r)| is_inside(c, r))
        .collect()
}
