//! Puts the pictures of several runs on one sheet: each planar map beside its view in space.
//!
//! `cargo run -p espalier-tests --example contact_sheet -- SHEET.png RUN…`
#![allow(clippy::print_stderr, reason = "a program")]

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use image::imageops::{self, FilterType};
use image::{ImageResult, Rgb, RgbImage};

const PANEL_PX: u32 = 300;
const GAP_PX: u32 = 6;
const RUNS_PER_ROW: u32 = 3;

fn main() -> ExitCode {
    let arguments: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let [sheet, runs @ ..] = arguments.as_slice() else {
        eprintln!("usage: contact_sheet SHEET.png RUN...");
        return ExitCode::from(2);
    };
    match make_sheet(runs).and_then(|picture| picture.save(sheet)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn make_sheet(runs: &[PathBuf]) -> ImageResult<RgbImage> {
    let n_rows = u32::try_from(runs.len()).unwrap_or(u32::MAX).div_ceil(RUNS_PER_ROW);
    let cell = PANEL_PX + GAP_PX;
    let mut sheet =
        RgbImage::from_pixel(2 * RUNS_PER_ROW * cell + GAP_PX, n_rows * cell + GAP_PX, Rgb([210; 3]));
    for (place, run) in (0_u32..).zip(runs) {
        let (x, y) = (2 * (place % RUNS_PER_ROW) * cell + GAP_PX, place / RUNS_PER_ROW * cell + GAP_PX);
        for (column, file) in (0_u32..).zip(["planar.png", "global-view.png"]) {
            let panel = panel(&run.join(file))?;
            imageops::replace(&mut sheet, &panel, i64::from(x + column * cell), i64::from(y));
        }
    }
    Ok(sheet)
}

/// A picture, scaled to fit a square panel, on white.
fn panel(file: &Path) -> ImageResult<RgbImage> {
    let picture = image::open(file)?.resize(PANEL_PX, PANEL_PX, FilterType::Lanczos3).to_rgb8();
    let mut panel = RgbImage::from_pixel(PANEL_PX, PANEL_PX, Rgb([255; 3]));
    let (left, top) = ((PANEL_PX - picture.width()) / 2, (PANEL_PX - picture.height()) / 2);
    imageops::replace(&mut panel, &picture, i64::from(left), i64::from(top));
    Ok(panel)
}
