//! Draws a tree over the projections of its mask, so that a person can judge it.
//!
//! `cargo run --release -p espalier-tests --example tree_over_mask -- PICTURE.png RUN [MASK]`
//!
//! Three views side by side: from the front (x, z), from the side (y, z), from above (x, y); the patient's right and front
//! are on the left, the head is on top. Grey is the mask, the darker the deeper along the view; branches have a colour
//! each, tips are black dots, the root is a red one, and what `topology.tsv` says was cut or dropped is a cross. `MASK` is
//! `RUN/stages/01-volume/mask.nii.gz` unless it is named.
#![allow(clippy::print_stderr, clippy::disallowed_methods, reason = "a program")]

use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use espalier_model::{Ledger, LedgerKind, Mask, Tree, swc};
use glam::{DVec2, DVec3};
use image::{Rgb, RgbImage};

/// Pixels of one view's longer side, and between views.
const VIEW_PX: f64 = 900.0;
const GAP_PX: f64 = 12.0;
/// Horizontal and vertical axis of each view.
const VIEWS: [[usize; 2]; 3] = [[0, 2], [1, 2], [0, 1]];
/// Colours of branches, apart from grey, red and black: six of ColorBrewer's Dark2.
const COLOURS: [[u8; 3]; 6] =
    [[27, 158, 119], [217, 95, 2], [117, 112, 179], [231, 41, 138], [102, 166, 30], [31, 120, 180]];

fn main() -> ExitCode {
    let arguments: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let [picture, run, mask @ ..] = arguments.as_slice() else {
        eprintln!("usage: tree_over_mask PICTURE.png RUN [MASK]");
        return ExitCode::from(2);
    };
    let mask = mask.first().cloned().unwrap_or_else(|| run.join("stages/01-volume/mask.nii.gz"));
    match draw(run, &mask).and_then(|drawn| Ok(drawn.save(picture)?)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

/// The box of the mask in the world, and where its views lie on the picture.
struct Frame {
    low: DVec3,
    high: DVec3,
    px_per_mm: f64,
}

impl Frame {
    /// The left edge of a view, in pixels.
    fn left(&self, view: usize) -> f64 {
        let widths =
            VIEWS[..view].iter().map(|axes| (self.high - self.low)[axes[0]] * self.px_per_mm + GAP_PX);
        GAP_PX + widths.sum::<f64>()
    }

    fn pixel(&self, view: usize, point: DVec3) -> DVec2 {
        let [across, up] = VIEWS[view];
        // The patient's right (small x) and front (large y) are on the viewer's left.
        let along = if across == 0 { point.x - self.low.x } else { self.high.y - point.y };
        DVec2::new(
            self.left(view) + along * self.px_per_mm,
            GAP_PX + (self.high[up] - point[up]) * self.px_per_mm,
        )
    }
}

fn draw(run: &Path, mask: &Path) -> Result<RgbImage, Box<dyn Error>> {
    let tree = swc::read_tree(&std::fs::read_to_string(run.join("tree.swc"))?)?;
    let ledger = Ledger::from_tsv(&std::fs::read_to_string(run.join("topology.tsv"))?)?;
    let params = espalier_volume::Params { method: espalier_volume::Method::Mask, ..Default::default() };
    let params = espalier_volume::Params { components: espalier_volume::Components::All, ..params };
    let mask = espalier_volume::read_mask(mask, &espalier_volume::ReadOptions::default(), &params)?.mask;

    let frame = frame_of(&mask);
    let height = VIEWS.iter().map(|axes| (frame.high - frame.low)[axes[1]]).fold(0.0, f64::max);
    let size = DVec2::new(frame.left(VIEWS.len()), height * frame.px_per_mm + 2.0 * GAP_PX).ceil();
    let mut picture = RgbImage::from_pixel(size.x as u32, size.y as u32, Rgb([255; 3]));
    for view in 0..VIEWS.len() {
        draw_mask(&mut picture, &frame, view, &mask);
        draw_tree(&mut picture, &frame, view, &tree);
        for entry in &ledger.0 {
            let is_lost = matches!(entry.kind, LedgerKind::LoopCut | LedgerKind::ComponentDropped);
            let is_bridge = entry.kind == LedgerKind::GapBridged;
            if is_lost || is_bridge {
                let colour = if is_bridge { [0, 90, 255] } else { [255, 0, 0] };
                cross(&mut picture, frame.pixel(view, entry.position_mm), colour);
            }
        }
    }
    Ok(picture)
}

fn frame_of(mask: &Mask) -> Frame {
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    if let Some((first, last)) = mask.bounding_box() {
        for corner in 0..8 {
            let voxel =
                [0, 1, 2].map(|axis| if corner >> axis & 1 == 0 { first[axis] } else { last[axis] } as f64);
            let point = mask.grid().world_from_voxel().transform_point3(DVec3::from_array(voxel));
            (low, high) = (low.min(point), high.max(point));
        }
    }
    Frame { low, high, px_per_mm: VIEW_PX / (high - low).max_element().max(f64::MIN_POSITIVE) }
}

/// Grey by how much of the mask a pixel's ray meets.
fn draw_mask(picture: &mut RgbImage, frame: &Frame, view: usize, mask: &Mask) {
    let mut depth = vec![0_u32; (picture.width() * picture.height()) as usize];
    // A voxel is as many pixels wide as its largest side.
    let half = (0.5 * mask.grid().spacing_mm().max_element() * frame.px_per_mm).ceil() as i64;
    for voxel in mask.voxels() {
        let point =
            mask.grid().world_from_voxel().transform_point3(DVec3::from_array(voxel.map(|c| c as f64)));
        let center = frame.pixel(view, point);
        for (x, y) in (-half..=half).flat_map(|dx| (-half..=half).map(move |dy| (dx, dy))) {
            let (x, y) = (center.x as i64 + x, center.y as i64 + y);
            if x >= 0 && y >= 0 && x < i64::from(picture.width()) && y < i64::from(picture.height()) {
                depth[(y * i64::from(picture.width()) + x) as usize] += 1;
            }
        }
    }
    let deepest = f64::from(depth.iter().copied().max().unwrap_or(0).max(1));
    for (pixel, &depth) in picture.pixels_mut().zip(&depth) {
        if depth > 0 {
            let grey = (225.0 - 85.0 * (f64::from(depth) / deepest).sqrt()) as u8;
            *pixel = Rgb([grey; 3]);
        }
    }
}

fn draw_tree(picture: &mut RgbImage, frame: &Frame, view: usize, tree: &Tree) {
    for (branch_idx, branch) in tree.branches().list().iter().enumerate() {
        let nodes: Vec<usize> = branch.polyline().collect();
        for edge in nodes.windows(2) {
            let [a, b] = [edge[0], edge[1]].map(|node| frame.pixel(view, tree.position_mm(node)));
            let n_steps = (2.0 * a.distance(b)).ceil().max(1.0) as usize;
            for step in 0..=n_steps {
                dot(picture, a.lerp(b, step as f64 / n_steps as f64), 1, COLOURS[branch_idx % COLOURS.len()]);
            }
        }
        if tree.children(branch.end()).is_empty() {
            dot(picture, frame.pixel(view, tree.position_mm(branch.end())), 3, [0; 3]);
        }
    }
    dot(picture, frame.pixel(view, tree.position_mm(0)), 6, [220, 0, 0]);
}

fn cross(picture: &mut RgbImage, at: DVec2, colour: [u8; 3]) {
    for step in -4..=4 {
        let step = f64::from(step);
        dot(picture, at + DVec2::new(step, step), 0, colour);
        dot(picture, at + DVec2::new(step, -step), 0, colour);
    }
}

/// A square of 2 · `half` + 1 pixels, as far as it is on the picture.
fn dot(picture: &mut RgbImage, center: DVec2, half: i64, colour: [u8; 3]) {
    for (dx, dy) in (-half..=half).flat_map(|dx| (-half..=half).map(move |dy| (dx, dy))) {
        let place = (u32::try_from(center.x as i64 + dx), u32::try_from(center.y as i64 + dy));
        if let (Ok(x), Ok(y)) = place
            && let Some(pixel) = picture.get_pixel_mut_checked(x, y)
        {
            *pixel = Rgb(colour);
        }
    }
}
