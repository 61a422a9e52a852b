//! What changes nothing: a folder verified, an input examined, places of a run, and what the program says of itself.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::words::parse_point;

/// `espalier verify`.
#[derive(Debug, Args)]
pub(crate) struct VerifyArguments {
    /// The run folder
    #[arg(value_name = "RUN")]
    pub(crate) folder: PathBuf,
}

const DOCTOR_HELP: &str = "\
Tells of a volume its format, shape, spacing, orientation, type and range, and whether it is a mask, a label map or a scan; of a
mask its volume, components and loops; of a folder of DICOM slices its series; of a traced tree its nodes, roots, branch points
and missing radii. Then warnings with their way out, a command to begin with, and seconds and memory of each stage of a run.
Nothing is written. Exit code 0 if every input can be read, else that of the first which cannot.

Examples:
  espalier doctor scan.nii.gz                           what is it?
  espalier doctor dicom/ --series 2 --preset airway
  espalier doctor masks/*.nii.gz --json --max-memory 4G would all of them fit?";

/// `espalier doctor`.
#[derive(Debug, Args)]
#[command(after_help = DOCTOR_HELP)]
pub(crate) struct DoctorArguments {
    /// Inputs, or configs (.toml)
    #[arg(required = true, value_name = "INPUT")]
    pub(crate) inputs: Vec<PathBuf>,
}

const PROFILE_HELP: &str = "\
Prints the rows of profiles.tsv on the way from the root, each node once, with its point in RAS+ mm: path length, radius,
the radius before and after, and by how much it falls short of that. With --plot it draws them instead: the radius against
the path length, borders of branches, mean and standard deviation of each generation on the way, the narrow places of
stenoses.tsv, and the narrowest place with its percentage.

Narrowing is diameter stenosis, 100 (1 - radius / reference), as in NASCET. NASCET's reference is the vessel beyond the
narrow place; ours is the smaller of the largest radii within ten radii before and after, which is the one beyond wherever
the vessel tapers. Inside of a fork there is no reference.

Examples:
  espalier profile out/airway --branch 17               to the end of a branch, as numbered in branches.tsv
  espalier profile out/airway --node 138                to a node, such as a tip, as numbered in nodes.tsv
  espalier profile out/airway --to=-32.7,-168.8,-161.8  to the node nearest to a point
  espalier profile out/airway --branch 17 --plot way.svg --set render.theme=dark";

/// `espalier profile`.
#[derive(Debug, Args)]
#[command(after_help = PROFILE_HELP)]
pub(crate) struct ProfileArguments {
    /// The run folder
    #[arg(value_name = "RUN")]
    pub(crate) folder: PathBuf,
    #[command(flatten)]
    pub(crate) place: PlaceArguments,
    /// Draw the way into this file, .svg or .png; render.theme, render.width_px, render.unit and render.title apply
    #[arg(long, value_name = "FILE")]
    pub(crate) plot: Option<PathBuf>,
}

/// Where the way leads: one of these.
#[derive(Debug, Args)]
#[group(required = true, multiple = false)]
pub(crate) struct PlaceArguments {
    /// To this node
    #[arg(long, visible_alias = "tip", value_name = "N")]
    pub(crate) node: Option<usize>,
    /// To the end of this branch
    #[arg(long, value_name = "N")]
    pub(crate) branch: Option<usize>,
    /// To the node nearest to this point, RAS+ mm
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_point, allow_hyphen_values = true)]
    pub(crate) to: Option<[f64; 3]>,
}

const LOCATE_HELP: &str = "\
Three numbers are a point of the patient, RAS+ mm: say --lps for coordinates of DICOM, ITK and ITK-SNAP, --voxel for indices
of the run's mask. Two are a point of the map, mm to the right and up as in nodes.tsv: say --pixel for pixels of planar.png.
The answer has the point on both sides, its branch with generation and radius, the path length from the root, and how far
off the centreline it lies; a point beyond the radius is \"outside\", and the nearest branch is named. One point is answered
with a line a quantity, several with a table.

Examples:
  espalier locate out/airway -32.7,-168.8,-161.8        where is this on the map?
  espalier locate out/airway 41.5,-80.2                 what does this place of the map show?
  espalier locate out/airway 812,440 --pixel            the same by a pixel of planar.png
  espalier locate out/airway 58,80,85 --voxel --json
  espalier locate out/airway --from points.tsv --lps    many points; - is standard input";

/// `espalier locate`.
#[derive(Debug, Args)]
#[command(after_help = LOCATE_HELP)]
pub(crate) struct LocateArguments {
    /// The run folder
    #[arg(value_name = "RUN")]
    pub(crate) folder: PathBuf,
    /// Points: X,Y,Z of the patient or U,V of the map
    #[arg(value_name = "X,Y,Z|U,V", required_unless_present = "from")]
    pub(crate) points: Vec<String>,
    /// Points from a table, one a line, numbers apart by tabs, commas or blanks; - is standard input
    #[arg(long, value_name = "FILE")]
    pub(crate) from: Option<PathBuf>,
    /// Three numbers are LPS+ mm, as in DICOM and ITK
    #[arg(long, conflicts_with = "voxel")]
    pub(crate) lps: bool,
    /// Three numbers are voxels of the run's mask, from 0
    #[arg(long)]
    pub(crate) voxel: bool,
    /// Two numbers are pixels of planar.png, from 0 at the upper left
    #[arg(long)]
    pub(crate) pixel: bool,
}

/// `espalier info`.
#[derive(Debug, Args)]
pub(crate) struct InfoArguments {
    /// Print the JSON Schema of the lines that --json prints on standard error
    #[arg(long)]
    pub(crate) events: bool,
}

/// `espalier config`.
#[derive(Debug, Subcommand)]
pub(crate) enum ConfigCommand {
    /// Print the JSON Schema of a config, for editors that complete keys and mark mistakes
    Schema,
    /// Type, unit, range, default and meaning of a key or of all keys of a section:  espalier config explain tree.root
    Explain(KeyArguments),
    /// Print a config to start with, commented:  espalier config init airway -o my.toml
    Init(InitArguments),
}

/// `espalier config explain`.
#[derive(Debug, Args)]
pub(crate) struct KeyArguments {
    /// A key such as tree.root, or a section such as embed.pso [default: all keys]
    pub(crate) key: Option<String>,
}

/// `espalier config init`.
#[derive(Debug, Args)]
pub(crate) struct InitArguments {
    /// What it is for; paper is the method as published
    #[arg(default_value = "airway", value_parser = ["airway", "vessel", "neuron", "paper"])]
    pub(crate) kind: String,
    /// Write to this file, which must not be there yet [default: print]
    #[arg(short, long, value_name = "FILE")]
    pub(crate) out: Option<PathBuf>,
}

/// `espalier explain`.
#[derive(Debug, Args)]
pub(crate) struct ExplainArguments {
    /// The code, as the message has it in square brackets [default: list all codes]
    pub(crate) code: Option<String>,
}
