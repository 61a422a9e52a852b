//! Times and peak memory of the pictures of large trees, and of a finished run's.
//!
//! `bench_pictures [WIDTH]` draws synthetic trees: the map alone, then all that a run makes of it; `bench_pictures RUN OUT [KEY=VALUE]…` draws a run folder's map into
//! OUT with these settings of `render`.
#![allow(clippy::print_stdout, clippy::expect_used, clippy::panic, reason = "a program")]
#![allow(clippy::disallowed_methods, reason = "a program takes the time")]

#[path = "../tests/common/mod.rs"]
mod common;

use std::path::Path;
use std::time::Instant;

use common::{fern, flat, front};
use espalier_model::{Embedding, Tree, ViewHierarchy, swc};
use espalier_render::{Params, Rendered, planar_png, planar_svg, render};

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.as_slice() {
        [run, out, settings @ ..] => draw(Path::new(run), Path::new(out), settings),
        rest => bench(rest.first().map_or(4096, |width| width.parse().expect("a width in pixels"))),
    }
}

/// Draws a run folder's map.
fn draw(run: &Path, out: &Path, settings: &[String]) {
    let read = |name: &str| std::fs::read_to_string(run.join(name)).expect(name);
    let tree = swc::read_tree(&read("tree.swc")).expect("a tree");
    let embedding = Embedding::from_json(&read("embedding.json"), &tree).expect("an embedding");
    let views = ViewHierarchy::from_json(&read("views.json"), &tree).expect("views");
    let pairs = settings.iter().map(|setting| {
        let (key, value) = setting.split_once('=').expect("KEY=VALUE");
        let value = serde_json::from_str(value).unwrap_or_else(|_| serde_json::Value::from(value));
        (key.to_owned(), value)
    });
    let params: Params = serde_json::from_value(pairs.collect()).expect("settings of render");
    std::fs::create_dir_all(out).expect("a folder");
    let made = timed(&tree, &embedding, &views, &params);
    std::fs::write(out.join("planar.png"), &made.png).expect("planar.png");
    std::fs::write(out.join("planar.svg"), &made.svg).expect("planar.svg");
    std::fs::write(out.join("global-view.png"), &made.global_view_png).expect("global-view.png");
    if let Some(pdf) = &made.pdf {
        std::fs::write(out.join("planar.pdf"), pdf).expect("planar.pdf");
    }
    if let Some(exr) = &made.exr {
        std::fs::write(out.join("planar.exr"), exr).expect("planar.exr");
    }
}

/// Draws trees of over twenty thousand edges: the map alone, with the global view, and all files.
fn bench(width_px: u32) {
    println!("tree\tedges\tfiles\tpixels\tseconds\tcpu_s\tpeak_mb\tlimit_mb\tpng_mb\texr_mb");
    for (name, scale) in [("stout", 1.0), ("slender", 0.3)] {
        let tree = fern(4, 11, 1.0);
        let nodes: Vec<_> = tree
            .nodes()
            .iter()
            .map(|node| espalier_model::Node { radius_mm: scale * node.radius_mm, ..*node })
            .collect();
        let tree = Tree::new(&nodes).expect("a tree");
        let print_row = |files: &str| print!("{name}\t{}\t{files}\t", tree.n_nodes() - 1);
        for has_svg in [false, true] {
            print_row(if has_svg { "map: PNG, SVG" } else { "map: PNG" });
            timed_alone(&tree, &flat(&tree), width_px, has_svg);
        }
        for all in [false, true] {
            let params = Params { width_px, exr: all, pdf: all, ..Params::default() };
            print_row(if all { "all" } else { "2 PNG, SVG" });
            timed(&tree, &flat(&tree), &front(&tree), &params);
        }
    }
}

/// Draws the map alone, and prints pixels, seconds and memory.
fn timed_alone(tree: &Tree, embedding: &Embedding, width_px: u32, has_svg: bool) {
    let params = Params { width_px, exr: false, pdf: false, ..Params::default() };
    let (before, cpu_before) = (Instant::now(), cpu_s());
    let png = planar_png(tree, embedding, &params).expect("a picture");
    let svg = has_svg.then(|| planar_svg(tree, embedding, &params).expect("a document"));
    let (seconds, cpu_s) = (before.elapsed().as_secs_f64(), cpu_s() - cpu_before);
    std::hint::black_box(svg);
    // Of a PNG's header.
    let side = |at: usize| u32::from_be_bytes([png[at], png[at + 1], png[at + 2], png[at + 3]]);
    let (width, height) = (f64::from(side(16)), f64::from(side(20)));
    let (limit_mb, png_mb) = (12.0 * width * height / 1e6 + 100.0, png.len() as f64 / 1e6);
    let peak_mb = peak_mb();
    println!("{width}×{height}\t{seconds:.2}\t{cpu_s:.2}\t{peak_mb:.0}\t{limit_mb:.0}\t{png_mb:.2}\t0.00");
}

/// Draws, and prints pixels, seconds and memory.
fn timed(tree: &Tree, embedding: &Embedding, views: &ViewHierarchy, params: &Params) -> Rendered {
    let (before, cpu_before) = (Instant::now(), cpu_s());
    let made = render(tree, embedding, views, params).expect("pictures");
    let (seconds, cpu_s) = (before.elapsed().as_secs_f64(), cpu_s() - cpu_before);
    let size = |key: &str| made.report.get(key).unwrap_or_default();
    let (width, height) = (size("width_px"), size("height_px"));
    let n_layers = if params.exr { 19.0 } else { 1.0 };
    let limit_mb = 12.0 * width * height * n_layers / 1e6 + 100.0;
    let exr_mb = made.exr.as_ref().map_or(0, Vec::len) as f64 / 1e6;
    let png_mb = made.png.len() as f64 / 1e6;
    println!(
        "{width}×{height}\t{seconds:.2}\t{cpu_s:.2}\t{:.0}\t{limit_mb:.0}\t{png_mb:.2}\t{exr_mb:.2}",
        peak_mb()
    );
    made
}

/// What all threads have worked so far, seconds: a busy machine does not blur it as it does the time that passes.
fn cpu_s() -> f64 {
    // Fields 14 and 15, counted behind the name in brackets, in hundredths of a second.
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields = stat.rsplit(')').next().unwrap_or_default().split_whitespace();
    fields.skip(11).take(2).filter_map(|ticks| ticks.parse::<f64>().ok()).sum::<f64>() / 100.0
}

/// The most memory that this program has held, MB.
fn peak_mb() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|line| line.starts_with("VmHWM"));
    line.and_then(|line| line.split_whitespace().nth(1)?.parse::<f64>().ok())
        .map_or(f64::NAN, |kb| kb / 1024.0)
}
