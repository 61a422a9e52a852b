//! How long each part of `embed` takes on degenerate trees.
//!
//! `cargo run --release -p espalier-embed --example part_times -- NAME[@SIZE]…`, a name one of `binary` (size: depth),
//! `fork` (the same with equal bends in one plane), `star`, `caterpillar`, `comb`, `chain`, `turns` (sizes: nodes).
//!
//! One line per tree: nodes N, crossings, mean angle error, E, the seconds of each method, of the search for sides
//! before the first, of the judging after the last, and of all. All views look one way: finding better ones is another stage.
#![allow(clippy::print_stdout, clippy::disallowed_methods, reason = "an example that measures")]

#[path = "../tests/common/mod.rs"]
mod common;

use std::error::Error;
use std::sync::Mutex;
use std::time::Instant;

use espalier_embed::{Event, Params, embed};
use espalier_geom::math;
use espalier_model::{Node, Tree};
use glam::DVec3;

fn main() -> Result<(), Box<dyn Error>> {
    for word in std::env::args().skip(1) {
        let (name, size) = word.split_once('@').unwrap_or((&word, "1000"));
        measure(name, &tree(name, size.parse()?)?)?;
    }
    Ok(())
}

fn measure(name: &str, tree: &Tree) -> Result<(), Box<dyn Error>> {
    let views = common::views_along(tree, DVec3::new(0.3, 0.5, 0.8).normalize());
    let start = Instant::now();
    let marks = Mutex::new(vec![("sides".to_owned(), start)]);
    let note = |event| {
        let name = match event {
            Event::Started { method } => method.name().to_owned(),
            Event::Finished { .. } => "judging".to_owned(),
            _ => return,
        };
        if let Ok(mut marks) = marks.lock() {
            marks.push((name, Instant::now()));
        }
    };
    let embedded = embed(tree, &views, &Params::default(), 0, &note)?;
    let mut marks = marks.into_inner()?;
    marks.push((String::new(), Instant::now()));
    let seconds = |pair: &[(String, Instant)]| (pair[1].1 - pair[0].1).as_secs_f64();
    let parts = marks.windows(2).filter(|pair| seconds(pair) >= 0.005);
    let parts: Vec<String> = parts.map(|pair| format!("{} {:.2}", pair[0].0, seconds(pair))).collect();
    let count = |name: &str| embedded.report.get(name).unwrap_or(f64::NAN);
    println!(
        "{name:<12} N {:>6} crossings {} angle {:.2}° E {:.4} sides {} -> {} {} s: {} in all {:.2}",
        tree.n_nodes(),
        embedded.embedding.certificate.crossings,
        count("angle3d_error_mean_deg"),
        embedded.embedding.energy.total(),
        count("mirror_crossings_before"),
        count("mirror_crossings"),
        embedded.embedding.method,
        parts.join(", "),
        start.elapsed().as_secs_f64(),
    );
    Ok(())
}

fn tree(name: &str, size: usize) -> Result<Tree, Box<dyn Error>> {
    let mut stream = common::stream(size as u32);
    let mut random = || DVec3::new(stream.normal(), stream.normal(), stream.normal()).normalize_or(DVec3::X);
    let mut nodes = vec![(DVec3::ZERO, None)];
    match name {
        "binary" | "fork" => {
            let mut ahead = vec![(DVec3::X, DVec3::Y)];
            for node in 1..(1 << size) - 1 {
                let parent = (node - 1) / 2;
                let (along, across) = ahead[parent];
                let side = if node % 2 == 0 { 0.6 } else { -0.6 };
                let (sin, cos) = math::sin_cos(side);
                let direction = along * cos + across * sin;
                // Each fork at right angles to the last, as in an airway, or all of them in one plane.
                let next = if name == "fork" { across * cos - along * sin } else { along.cross(across) };
                ahead.push((direction, next));
                nodes.push((nodes[parent].0 + direction, Some(parent)));
            }
        }
        "star" => nodes.extend((0..size).map(|_| (random(), Some(0)))),
        "caterpillar" | "comb" => {
            for pair in 0..size / 2 {
                let from = if pair == 0 { 0 } else { 2 * pair - 1 };
                let (spine, tooth) =
                    if name == "comb" { (DVec3::X, DVec3::Y * 20.0) } else { (random(), random()) };
                nodes.push((nodes[from].0 + spine, Some(from)));
                nodes.push((nodes[2 * pair + 1].0 + tooth, Some(2 * pair + 1)));
            }
        }
        "chain" => (1..size).for_each(|node| nodes.push((nodes[node - 1].0 + DVec3::X, Some(node - 1)))),
        "turns" => (1..size).for_each(|node| nodes.push((nodes[node - 1].0 + random(), Some(node - 1)))),
        _ => return Err(format!("no tree is called {name}").into()),
    }
    let node = |(position_mm, parent)| Node { position_mm, radius_mm: 0.01, parent, kind: 0 };
    Ok(Tree::new(&nodes.into_iter().map(node).collect::<Vec<_>>())?)
}
