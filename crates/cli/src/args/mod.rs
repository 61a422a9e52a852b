//! The command line, by kind of command.
//!
//! | file | commands |
//! |---|---|
//! | `runs` | one run, one stage, a phantom |
//! | `many` | several runs: compared, juxtaposed, swept, in groups and cohorts |
//! | `asks` | what changes nothing: verify, doctor, profile, locate, info, config, explain |
//! | `words` | what a word of the command line means: sizes, points, keys with values |

mod asks;
mod many;
mod runs;
mod words;

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};
use espalier_pipeline::Override;

pub(crate) use asks::{
    ConfigCommand, DoctorArguments, ExplainArguments, InfoArguments, InitArguments, KeyArguments,
    LocateArguments, PlaceArguments, ProfileArguments, VerifyArguments,
};
pub(crate) use many::{
    BidsArguments, CohortArguments, CompareArguments, GroupArguments, JuxtaposeArguments, PageArguments,
    SweepArguments,
};
pub(crate) use runs::{PhantomArguments, Rerun, RunArguments, StageArguments};
pub(crate) use words::shield_point;
use words::{parse_override, parse_size};

const EXAMPLES: &str = "\
Examples:
  espalier run pipelines/airway.toml                    the embedded phantom, from CT to picture
  espalier run neuron.swc -o out/neuron                 a traced tree, every setting at its default
  espalier run chest-ct.nii.gz --preset airway          airways, from the trachea to before the leak
  espalier run scan.nii.gz --set volume.method=region-grow \\
      --set volume.upper=-865 --set 'volume.seed_voxel=[58,80,85]'
  espalier run chest-ct.nii.gz --preset airway --set render.style=volume
                                                        the scan along the airways: a reformation of the whole tree
  espalier render out/bronchi --set render.style=volume --image chest-ct.nii.gz
                                                        the same of a run that began with a mask
  espalier run dicom/ --series 2 --set volume.method=threshold --set volume.lower=200
                                                        a folder of DICOM slices; of several series the second
  espalier run my.toml --from embed --set embed.w_angle=3    again from a stage on
  espalier embed out/airway --set embed.pso.freedom=s   one stage of a run folder
  espalier skeleton mask.nii.gz -o out/skeleton         one stage on files
  espalier compare out/airway                           its methods side by side: table and figure
  espalier doctor scan.nii.gz                           what is this file, and what would a run of it cost?
  espalier verify out/airway                            does everything hold that the folder says?
  espalier locate out/airway -32.7,-168.8,-161.8        where is this point of the scan on the map?
  espalier sweep my.toml --over embed.w_length=0.5,1,2  losses against a setting: table and plot
  espalier group out -o group                           one page over all runs in a folder
  espalier cohort samples.tsv -o out/cohort             all scans of a table, and the page over them
  espalier bids data out participant --suffix mask      the volumes of a BIDS data set
  espalier phantom airway -o phantoms/airway            test data with its truth
  espalier config init vessel -o my.toml                a config to start with
  espalier config explain tree.root                     what a key means, its default and its range
  espalier explain E-VOLUME-NO-SPACE                    what an error code means, and the way out

Exit codes:
  0 done   1 a bug of ours   2 usage or config   3 input malformed or empty   5 over a stated limit
  6 topology refused by policy   8 no certified layout, an altered file, or a claim that does not hold
  73 cannot create   74 missing or unreadable file, I/O   75 another run holds the folder   130, 143 cancelled";

/// A CT scan of a treelike organ, airways or vessels, or a traced neuron, grown flat: one planar picture of
/// every branch, without overlaps.
#[derive(Debug, Parser)]
#[command(version, after_help = EXAMPLES, max_term_width = 110)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    pub(crate) command: Command,
    #[command(flatten)]
    pub(crate) common: Common,
}

/// Options of every command.
#[derive(Debug, Args)]
pub(crate) struct Common {
    /// Change a config key, such as embed.w_angle=3; may be given many times
    #[arg(long = "set", value_name = "KEY=VALUE", global = true, value_parser = parse_override)]
    pub(crate) overrides: Vec<Override>,
    /// What a scan shows: airway (grown from the trachea, which is found; the tree's root is then the superior tip,
    /// unless tree.root is set) or vessel (with contrast); short for --set volume.preset
    #[arg(long, global = true, value_name = "airway|vessel", value_parser = ["airway", "vessel"])]
    pub(crate) preset: Option<String>,
    /// The organ in a label map, by value or name, several with commas; short for --set volume.label
    #[arg(long, global = true, value_name = "LABEL")]
    pub(crate) label: Option<String>,
    /// A file with the names of a label map's values, for --label (ITK-SNAP, 3D Slicer, BIDS, JSON, or lines "1 left
    /// lung"); short for --set input.labels
    #[arg(long, global = true, value_name = "FILE")]
    pub(crate) labels: Option<PathBuf>,
    /// The scan that --set render.style=volume shows along the branches, where the input is a mask, a label map or a
    /// traced tree; short for --set render.volume.image
    #[arg(long, global = true, value_name = "FILE")]
    pub(crate) image: Option<PathBuf>,
    /// Which volume of a 4D file, from 0; the same as --set input.volume_index=N
    #[arg(long, global = true, value_name = "N")]
    pub(crate) volume_index: Option<u32>,
    /// The space of a file that does not name its own: where its axes point; the same as --set input.assume_space=…
    #[arg(long, global = true, value_name = "ras|las|lps", value_parser = ["ras", "las", "lps"])]
    pub(crate) assume_space: Option<String>,
    /// Refuse what would otherwise be repaired with a warning; the same as --set input.strict=true
    #[arg(long, global = true)]
    pub(crate) strict: bool,
    /// Which DICOM series of a folder, from 1 as the message lists them; the same as --set input.series=N
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) series: Option<u32>,
    /// Resample a tilted, uneven or incomplete DICOM series to an even grid; the same as --set input.resample=true
    #[arg(long, global = true)]
    pub(crate) resample: bool,
    /// Threads to use [default: one per core]; no result depends on it
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) threads: Option<u16>,
    /// The most memory that a stage may take, such as 4G [default: half of the machine's]
    #[arg(long, global = true, value_name = "SIZE", value_parser = parse_size)]
    pub(crate) max_memory: Option<u64>,
    /// Share results between runs that agree: what another run has made from the same files and settings is copied from
    /// this folder, and what this one makes is stored there [default: $ESPALIER_CACHE, else none]; it may be removed at any
    /// time
    #[arg(long, global = true, value_name = "DIR")]
    pub(crate) cache: Option<PathBuf>,
    /// How large that folder may be after a run; what was used least lately goes first
    #[arg(long, global = true, value_name = "SIZE", default_value = "20G", value_parser = parse_size)]
    pub(crate) cache_size: u64,
    /// Speak to programs: results as JSON on standard output, and on standard error a JSON object a line for all that
    /// happens, as espalier info --events describes them; the last one of a command that fails says why
    #[arg(long, global = true)]
    pub(crate) json: bool,
    /// Print results, warnings, remarks and errors only, and that a run waits for another
    #[arg(short, long, global = true)]
    pub(crate) quiet: bool,
    /// Say more: the settings that are not at their default, and why a stage is done; -vv also what each stage counted,
    /// and what its parts took
    #[arg(short, long, global = true, action = clap::ArgAction::Count, conflicts_with = "quiet")]
    pub(crate) verbose: u8,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Run a whole pipeline: from a config, or from an input with every setting at its default
    Run(RunArguments),
    /// Methods or runs side by side: one table, one figure
    Compare(CompareArguments),
    /// A baseline and a follow-up on one shared map: lost and new branches, changes of radius
    Juxtapose(JuxtaposeArguments),
    /// A config at many settings: a table and a plot of the losses
    Sweep(SweepArguments),
    /// One page over many runs: maps, numbers, outliers, failures
    Group(GroupArguments),
    /// Many scans from one table, each with its own settings; then one page over all:  espalier cohort SAMPLES.tsv
    Cohort(CohortArguments),
    /// The volumes of a BIDS data set, and the page over them:  espalier bids IN OUT participant, then group
    Bids(BidsArguments),
    /// Make a phantom with its truth: CT, mask and tree
    Phantom(PhantomArguments),
    /// CT or label map -> mask:  espalier volume CT -o DIR
    Volume(StageArguments),
    /// Mask -> curve skeleton:  espalier skeleton MASK -o DIR
    Skeleton(StageArguments),
    /// Inscribed spheres:  espalier radius MASK SKELETON -o DIR
    Radius(StageArguments),
    /// One rooted tree:  espalier tree MASK SKELETON SPHERES -o DIR, or espalier tree TRACED.swc -o DIR (or .vtp, .vtk)
    Tree(StageArguments),
    /// Views and local planes:  espalier views TREE -o DIR
    Views(StageArguments),
    /// Planar embedding:  espalier embed TREE VIEWS -o DIR
    Embed(StageArguments),
    /// Pictures:  espalier render TREE VIEWS EMBEDDING -o DIR
    Render(StageArguments),
    /// The page of a run, report.html:  espalier report RUN
    Report(StageArguments),
    /// Check a run folder: digests, certificate, and every number computed again:  espalier verify RUN
    Verify(VerifyArguments),
    /// The calibre on the way from the root to a place of a run:  espalier profile RUN --node N
    Profile(ProfileArguments),
    /// From the scan to the map and back, of a run:  espalier locate RUN X,Y,Z, or espalier locate RUN U,V
    Locate(LocateArguments),
    /// What this program is: versions of its stages, target, formats, limits, threads and memory here
    Info(InfoArguments),
    /// Configs: every key and its meaning, the JSON Schema, one to start with
    #[command(subcommand)]
    Config(ConfigCommand),
    /// What an error or warning code means and what to do:  espalier explain E-VOLUME-NO-SPACE
    Explain(ExplainArguments),
    /// What an input is, what is to be said of it, which command suits it, and what that would cost:  espalier doctor FILE
    Doctor(DoctorArguments),
    /// Print a script that completes commands and options in a shell:  espalier completions bash
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
}

impl Command {
    /// Its name, as it is typed.
    pub(crate) fn name(&self) -> &'static str {
        match self {
            Self::Run(_) => "run",
            Self::Compare(_) => "compare",
            Self::Juxtapose(_) => "juxtapose",
            Self::Sweep(_) => "sweep",
            Self::Group(_) => "group",
            Self::Cohort(_) => "cohort",
            Self::Bids(_) => "bids",
            Self::Phantom(_) => "phantom",
            Self::Volume(_) => "volume",
            Self::Skeleton(_) => "skeleton",
            Self::Radius(_) => "radius",
            Self::Tree(_) => "tree",
            Self::Views(_) => "views",
            Self::Embed(_) => "embed",
            Self::Render(_) => "render",
            Self::Report(_) => "report",
            Self::Verify(_) => "verify",
            Self::Profile(_) => "profile",
            Self::Locate(_) => "locate",
            Self::Info(_) => "info",
            Self::Config(_) => "config",
            Self::Explain(_) => "explain",
            Self::Doctor(_) => "doctor",
            Self::Completions { .. } => "completions",
        }
    }
}

impl Arguments {
    /// Adds the keys that have an option of their own to those of `--set`: a preset before them, so that they have
    /// the last word, the others after.
    pub(crate) fn with_all_overrides(mut self) -> Self {
        let set = |key: &str, value: String| Override { key: key.to_owned(), value };
        let common = &mut self.common;
        let preset = common.preset.take().map(|preset| set("volume.preset", preset));
        common.overrides.splice(..0, preset);
        // Quoted, so that numbers with commas stay one value.
        let label = common.label.take().map(|label| set("volume.label", format!("{label:?}")));
        let series = common.series.map(|index| set("input.series", index.to_string()));
        let resample = common.resample.then(|| set("input.resample", "true".to_owned()));
        // From here, not from the config's folder.
        let from_here = |path: PathBuf| std::path::absolute(&path).unwrap_or(path);
        let labels = common.labels.take().map(|path| set("input.labels", format!("{:?}", from_here(path))));
        let image =
            common.image.take().map(|path| set("render.volume.image", format!("{:?}", from_here(path))));
        let index = common.volume_index.map(|index| set("input.volume_index", index.to_string()));
        let space = common.assume_space.take().map(|space| set("input.assume_space", space));
        let strict = common.strict.then(|| set("input.strict", "true".to_owned()));
        common
            .overrides
            .extend([label, labels, image, index, space, strict, series, resample].into_iter().flatten());
        self
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        Arguments::command().debug_assert();
    }
}
