//! How good and how fast the embedding is, as tables.
//!
//! `cargo run --release -p espalier-tests --example bench_embed -- [MODE] [OPTION]… [FOLDER|FILE]…`
//!
//! | mode | table |
//! |---|---|
//! | (none) | every tree by every method, and what follows from it |
//! | `--scale` | time against size, on phantoms |
//! | `--against-pso` | the solver against the paper's swarm at equal freedom and equal seconds |
//! | `--ablation` | the solver without one of its parts |
//! | `--campaign` | random trees of eight families: crossings, and what fails |
//!
//! Options: `--sizes` takes the phantoms of `--scale` for any table, `--trees N` and `--seed N` are for the campaign,
//! `--largest N` leaves out larger trees, `--swarm full|small|none`.
//! Folders are searched for `.swc` files; `g9` among them is an airway phantom of 4099 nodes that stays crowded; without
//! any, phantoms are grown. Lines are printed as they come; all times are wall-clock seconds.
#![allow(clippy::print_stdout, clippy::disallowed_methods, reason = "an example that measures")]

mod ablation;
mod against_pso;
mod campaign;
mod measure;
mod methods;
mod scale;
mod trees;

use std::error::Error;
use std::path::PathBuf;
use std::process::ExitCode;

/// How large the swarm of the table is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Swarm {
    Full,
    Small,
    None,
}

/// What the command line says.
struct Options {
    mode: Mode,
    paths: Vec<PathBuf>,
    has_sizes: bool,
    largest: usize,
    n_trees: u32,
    seed: u32,
    swarm: Swarm,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Mode {
    Methods,
    Scale,
    AgainstPso,
    Ablation,
    Campaign,
}

fn main() -> Result<ExitCode, Box<dyn Error>> {
    let options = options()?;
    let is_good = match options.mode {
        Mode::Methods => methods::print(&options)?,
        Mode::Scale => scale::print(&options)?,
        Mode::AgainstPso => against_pso::print(&options)?,
        Mode::Ablation => ablation::print(&options)?,
        Mode::Campaign => campaign::print(&options)?,
    };
    Ok(if is_good { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn options() -> Result<Options, Box<dyn Error>> {
    let mut options = Options {
        mode: Mode::Methods,
        paths: Vec::new(),
        has_sizes: false,
        largest: usize::MAX,
        n_trees: 10_000,
        seed: 0,
        swarm: Swarm::Full,
    };
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        let mut value = || words.next().ok_or(format!("{word} needs a value"));
        match word.as_str() {
            "--sizes" => options.has_sizes = true,
            "--scale" => options.mode = Mode::Scale,
            "--against-pso" => options.mode = Mode::AgainstPso,
            "--ablation" => options.mode = Mode::Ablation,
            "--campaign" => options.mode = Mode::Campaign,
            "--largest" => options.largest = value()?.parse()?,
            "--trees" => options.n_trees = value()?.parse()?,
            "--seed" => options.seed = value()?.parse()?,
            "--swarm" => {
                options.swarm = match value()?.as_str() {
                    "full" => Swarm::Full,
                    "small" => Swarm::Small,
                    "none" => Swarm::None,
                    other => return Err(format!("--swarm {other}: full, small or none").into()),
                }
            }
            option if option.starts_with("--") => return Err(format!("there is no option {option}").into()),
            path => options.paths.push(PathBuf::from(path)),
        }
    }
    Ok(options)
}
