//! One stage from scan to tree on one file, timed alone: for `scripts/bench`.
//!
//! `cargo run --release -p espalier-tests --example bench_stages -- --phase PHASE [--threads N] FILE`
//!
//! Prints a line of seconds (the best of several), peak memory of the process in MiB, and what came out, with tabs
//! between. What a stage needs is made before the clock starts; `whole` is everything from the file to the tree.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program")]
#![allow(clippy::disallowed_methods, reason = "a benchmark reads the clock")]

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use clap::{Parser, ValueEnum};
use espalier_model::{InscribedSpheres, Mask, Skeleton};
use espalier_skeleton::Thinning;

/// Repeats stop after this many, or after [`ENOUGH_SECONDS`].
const MOST_REPEATS: usize = 7;
const ENOUGH_SECONDS: f64 = 3.0;

#[derive(Parser)]
struct Arguments {
    /// What to time.
    #[arg(long)]
    phase: Phase,
    /// Threads to use.
    #[arg(long, default_value_t = 1)]
    threads: usize,
    /// Where to write the skeleton, or the distances, as `.nii.gz`, to be compared with a peer's.
    #[arg(long)]
    out: Option<PathBuf>,
    /// A mask.
    file: PathBuf,
}

#[derive(Clone, Copy, ValueEnum)]
enum Phase {
    /// The file to a mask of bits.
    Load,
    /// Largest component, cavities filled.
    Clean,
    /// Thinning as published.
    ThinningLee94,
    /// Thinning by default.
    ThinningSafe,
    /// Exact distances to the background at the skeleton, and nothing else: what `edt` gives there.
    RadiiDistances,
    /// Inscribed spheres at the skeleton: distances, sub-voxel centres, cross-sections.
    RadiiSpheres,
    /// Skeleton and spheres to one rooted tree.
    Tree,
    /// The file to the tree.
    Whole,
}

type Outcome<T> = Result<T, Box<dyn std::error::Error + Send + Sync>>;

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    match measure(&arguments) {
        Ok((seconds, result)) => {
            println!("{seconds:.6}\t{:.1}\t{result}", peak_mib());
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("error: {}: {error}", arguments.file.display());
            ExitCode::FAILURE
        }
    }
}

fn measure(arguments: &Arguments) -> Outcome<(f64, String)> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(arguments.threads).build()?;
    pool.install(|| time_phase(arguments.phase, &arguments.file, arguments.out.as_deref()))
}

fn time_phase(phase: Phase, file: &Path, out: Option<&Path>) -> Outcome<(f64, String)> {
    let voxels = |n: usize| format!("{n} voxels");
    match phase {
        Phase::Load => best_of(|| Ok(voxels(load(file)?.n_foreground()))),
        Phase::Whole => best_of(|| whole(file)),
        Phase::Clean => {
            let mask = load(file)?;
            best_of(|| Ok(voxels(clean(mask.clone())?.n_foreground())))
        }
        Phase::ThinningLee94 | Phase::ThinningSafe => {
            let mask = load(file)?;
            let is_safe = matches!(phase, Phase::ThinningSafe);
            let thinning = if is_safe { Thinning::Safe } else { Thinning::Lee94 };
            if let Some(out) = out {
                std::fs::write(out, espalier_model::nifti_out::skeleton(&thin(&mask, thinning)?)?)?;
            }
            best_of(|| Ok(voxels(thin(&mask, thinning)?.voxels().len())))
        }
        Phase::RadiiDistances => {
            let mask = load(file)?;
            let skeleton = thin(&mask, Thinning::Safe)?;
            if let Some(out) = out {
                let values: Vec<f32> =
                    espalier_radius::distances_mm(&mask, &skeleton)?.iter().map(|&mm| mm as f32).collect();
                std::fs::write(out, espalier_model::nifti_out::skeleton_scalars(&skeleton, &values)?)?;
            }
            best_of(|| Ok(format!("{} distances", espalier_radius::distances_mm(&mask, &skeleton)?.len())))
        }
        Phase::RadiiSpheres => {
            let mask = load(file)?;
            let skeleton = thin(&mask, Thinning::Safe)?;
            best_of(|| Ok(format!("{} spheres", measure_radii(&mask, &skeleton)?.0.len())))
        }
        Phase::Tree => {
            let mask = load(file)?;
            let skeleton = thin(&mask, Thinning::Safe)?;
            let spheres = measure_radii(&mask, &skeleton)?;
            best_of(|| grow(&mask, &skeleton, &spheres))
        }
    }
}

/// The least time of several calls, and the last one's result.
fn best_of(mut call: impl FnMut() -> Outcome<String>) -> Outcome<(f64, String)> {
    let (mut best, mut spent) = (f64::INFINITY, 0.0);
    let mut result = String::new();
    for _ in 0..MOST_REPEATS {
        let start = Instant::now();
        result = call()?;
        let seconds = start.elapsed().as_secs_f64();
        (best, spent) = (f64::min(best, seconds), spent + seconds);
        if spent > ENOUGH_SECONDS {
            break;
        }
    }
    Ok((best, result))
}

fn whole(file: &Path) -> Outcome<String> {
    let mask = clean(load(file)?)?;
    let skeleton = thin(&mask, Thinning::Safe)?;
    let spheres = measure_radii(&mask, &skeleton)?;
    grow(&mask, &skeleton, &spheres)
}

/// The file as a mask, nothing dropped, in the file's own order, which the peers see.
fn load(file: &Path) -> Outcome<Mask> {
    let params = espalier_volume::Params {
        components: espalier_volume::Components::All,
        orientation: espalier_volume::Orientation::Stored,
        fill_cavities: false,
        close_tunnels: false,
        ..espalier_volume::Params::default()
    };
    Ok(espalier_volume::read_mask(file, &espalier_volume::ReadOptions::default(), &params)?.mask)
}

fn clean(mask: Mask) -> Outcome<Mask> {
    Ok(espalier_volume::clean(mask, &espalier_volume::Params::default())?.mask)
}

fn thin(mask: &Mask, thinning: Thinning) -> Outcome<Skeleton> {
    let params = espalier_skeleton::Params { thinning };
    Ok(espalier_skeleton::skeletonize(mask, &params)?.skeleton)
}

fn measure_radii(mask: &Mask, skeleton: &Skeleton) -> Outcome<InscribedSpheres> {
    Ok(espalier_radius::inscribed_spheres(mask, skeleton, &espalier_radius::Params::default())?.spheres)
}

fn grow(mask: &Mask, skeleton: &Skeleton, spheres: &InscribedSpheres) -> Outcome<String> {
    let tree = espalier_tree::build(mask, skeleton, spheres, &espalier_tree::Params::default())?.tree;
    Ok(format!("{} nodes, {} tips", tree.n_nodes(), tree.n_tips()))
}

/// The most memory that the process held, in MiB; NaN where the system does not tell.
fn peak_mib() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap_or_default();
    line.trim().trim_end_matches(" kB").trim().parse::<f64>().map_or(f64::NAN, |kib| kib / 1024.0)
}
