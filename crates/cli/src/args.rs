//! The command line.

use std::ffi::OsString;
use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};
use espalier_pipeline::{Axis, Override, Stage};

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
    /// Print results, warnings and errors only
    #[arg(short, long, global = true)]
    pub(crate) quiet: bool,
    /// Say more: the settings that are not at their default, and why a stage is done; -vv also what each stage counted,
    /// and what its parts took
    #[arg(short, long, global = true, action = clap::ArgAction::Count, conflicts_with = "quiet")]
    pub(crate) verbose: u8,
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

/// `espalier run`.
#[derive(Debug, Args)]
pub(crate) struct RunArguments {
    /// A config (.toml), or an input: a volume (.nii, .nii.gz, .hdr, .nrrd, .nhdr, .mha, .mhd, a folder of
    /// DICOM slices) or a traced tree (.swc, .vtp, .vtk)
    pub(crate) config_or_input: PathBuf,
    /// The run folder [default: out/NAME]
    #[arg(short, long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Begin at this stage, with what the earlier ones left in the run folder
    #[arg(long, value_name = "STAGE", value_parser = parse_stage)]
    pub(crate) from: Option<Stage>,
    /// End after this stage
    #[arg(long, value_name = "STAGE", value_parser = parse_stage)]
    pub(crate) to: Option<Stage>,
    /// Do nothing; say which stages would be done, and why
    #[arg(long)]
    pub(crate) dry_run: bool,
    #[command(flatten)]
    pub(crate) rerun: Rerun,
}

/// How a command deals with a run folder that is in use.
#[derive(Clone, Copy, Debug, Args)]
pub(crate) struct Rerun {
    /// Do stages again also where their results stand: made from the same files and settings, and not altered since; and
    /// write over files that no run has made
    #[arg(long)]
    pub(crate) force: bool,
    /// Wait for another run that holds the folder, rather than to stop with exit code 75
    #[arg(long)]
    pub(crate) wait: bool,
}

const JUXTAPOSE_HELP: &str = "\
The follow-up is moved onto the baseline by the forks that match (no images are registered), branches are matched from
the root on, and the tree of both is laid flat once, with the baseline's settings: what both have lies in the same place
of both panels, at the baseline's lengths.

Writes into the folder: juxtaposition.png and juxtaposition.svg (both trees at one scale, differences coloured),
juxtaposition.tsv (a row per branch: matched, lost or new; lengths, radii, their change, the narrowest place, angles),
juxtaposition.json (how the follow-up was moved, what that leaves in mm), shared.swc, shared-nodes.tsv and
shared-embedding.json (the tree of both), dictionary.tsv (what each column means).

Examples:
  espalier juxtapose out/2023 out/2024 -o out/change         two runs
  espalier juxtapose before.nii.gz after.nii.gz              runs both up to the tree first
  espalier juxtapose out/a out/b --align similarity          an animal that grew
  espalier juxtapose out/a out/b --change length             colours by change of length";

/// `espalier juxtapose`.
#[derive(Debug, Args)]
#[command(after_help = JUXTAPOSE_HELP)]
pub(crate) struct JuxtaposeArguments {
    /// The baseline: a run folder; or a config (.toml) or an input, which is run first, to a folder of its name in DIR
    #[arg(value_name = "BASELINE")]
    pub(crate) baseline: PathBuf,
    /// The follow-up, likewise
    #[arg(value_name = "FOLLOWUP")]
    pub(crate) followup: PathBuf,
    /// Where the results go
    #[arg(short, long, value_name = "DIR", default_value = "out/juxtapose")]
    pub(crate) out: PathBuf,
    /// How the follow-up is brought to the baseline: turned and moved; scaled too; or as it is, in the same space
    #[arg(long, value_name = "HOW", default_value = "rigid", value_parser = ["rigid", "similarity", "as-is"])]
    pub(crate) align: String,
    /// What the colours mean
    #[arg(long, value_name = "WHAT", default_value = "radius", value_parser = ["radius", "length"])]
    pub(crate) change: String,
}

const COMPARE_HELP: &str = "\
Writes into the folder: compare.tsv and compare.json (a row per run and method), compare.png and compare.svg (each tree
in space, then every method's layout, main subtrees in the same colours), dictionary.tsv (what each column means).
Which methods a run has is set by embed.methods; they share one set of targets and one energy.

Examples:
  espalier compare out/airway                            the methods of a run
  espalier compare out/a out/b out/c -o out/abc          runs: rows that compare share tree and targets
  espalier compare neuron.swc --set embed.pso.freedom=s  runs it up to the embedding first
  espalier compare out/airway --set render.theme=dark    of finished runs, the pictures can be set";

/// `espalier compare`.
#[derive(Debug, Args)]
#[command(after_help = COMPARE_HELP)]
pub(crate) struct CompareArguments {
    /// Run folders; or configs (.toml) and inputs, which are run first, each to a folder of its name in DIR
    #[arg(required = true, value_name = "RUN|CONFIG")]
    pub(crate) subjects: Vec<PathBuf>,
    /// Where the results go
    #[arg(short, long, value_name = "DIR", default_value = "out/compare")]
    pub(crate) out: PathBuf,
}

const SWEEP_HELP: &str = "\
Embeds the config at every combination of the values; stages that no key changes run once. Writes into the folder:
sweep.tsv (a row per combination: its values, the row of its embedding as in compare.tsv, or the reason why there is
none), sweep.png and sweep.svg (losses against the first key, one line for each combination of the others), base/ and
runs/NNN/ (the stages' own files). Energies at different weights do not compare; losses do.

Examples:
  espalier sweep neuron.swc --over embed.w_length=0.5,1,2,4
  espalier sweep my.toml --over embed.w_length=0.5,1,2,4 --over embed.w_angle=1,2,4 -o out/weights
  espalier sweep my.toml --over embed.method=radial,marino,solver     words need no quotes
  espalier sweep my.toml --over 'volume.seed_voxel=[1,2,3],[4,5,6]'   commas inside brackets do not part values";

/// `espalier sweep`.
#[derive(Debug, Args)]
#[command(after_help = SWEEP_HELP)]
pub(crate) struct SweepArguments {
    /// A config (.toml), or an input: a volume (.nii, .nii.gz, .hdr, .nrrd, .nhdr, .mha, .mhd, a folder of
    /// DICOM slices) or a traced tree (.swc, .vtp, .vtk)
    pub(crate) config_or_input: PathBuf,
    /// A key and its values; may be given many times, for all combinations
    #[arg(long = "over", value_name = "KEY=V1,V2,…", required = true, value_parser = parse_axis)]
    pub(crate) axes: Vec<Axis>,
    /// Where the results go [default: out/NAME-sweep]
    #[arg(short, long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
}

const GROUP_HELP: &str = "\
Writes into the folder: group.html (one file: the maps in small, a table that sorts and filters, distributions, outliers,
runs without a map with the reason and the commands that try again, equal inputs, settings that differ), group.tsv and
group.json (a row per run), dictionary.tsv (what each column means).

Runs are labelled with their folders as you type them, without what all have in common; nothing else of a run's name or
input is on the page. If folders are named after patients, say --anonymous. A run that cannot be read, or has not come to a
map, is a row with its reason; exit code 74 if no folder holds a run.

Examples:
  espalier group out -o group                           all run folders in out
  espalier group out/case-* -o group --title \"Cohort A\"
  espalier group out --anonymous -o share               labels run-1, run-2, …";

/// `espalier group`.
#[derive(Debug, Args)]
#[command(after_help = GROUP_HELP)]
pub(crate) struct GroupArguments {
    /// Run folders, or folders that have run folders in them
    #[arg(required = true, value_name = "RUN|FOLDER")]
    pub(crate) folders: Vec<PathBuf>,
    /// Where the results go
    #[arg(short, long, value_name = "DIR", default_value = "out/group")]
    pub(crate) out: PathBuf,
    /// The heading of the page
    #[arg(long, value_name = "TEXT")]
    pub(crate) title: Option<String>,
    /// Number the runs in place of their folders' names
    #[arg(long)]
    pub(crate) anonymous: bool,
}

const COHORT_HELP: &str = "\
The table has tabs between its cells, a heading, and a row a scan. Columns:
  id            what the scan is called: its run folder is DIR/runs/ID
  path          the scan, mask, label map or traced tree, relative to the table; $ESPALIER_DATA is expanded
  config        a config (.toml) to run it with, relative to the table
  preset, label, labels, image, series, volume_index, seed      as the options of these names
  embed.w_angle, tree.root, ...                                 any key of the config
  note, note.age, ...                                           yours; not read
Only id is needed, and path or config. An empty cell, or n/a, says nothing; lines that begin with # are passed over.
Options of the command line have the last word over all rows.

Does one scan after the other, and then DIR/group/group.html. A scan that fails stops no other: DIR/failures.tsv has the
reason and the command that tries it again. The same command again does only what is missing, has failed, or has other
settings or files now. The exit code is that of the first scan that failed. Two such calls at once in one folder: one goes on,
the other ends with exit code 75, or waits with --wait; calls with --only may run beside each other.
pipelines/cohort/Snakefile does the same with many jobs at once, here or on a cluster.

Examples:
  espalier cohort samples.tsv -o out/cohort
  espalier cohort samples.tsv -o out/cohort --config airway.toml --set embed.w_angle=3
  espalier cohort samples.tsv -o out/cohort --only case-07      one scan, without the page
  espalier cohort samples.tsv -o out/cohort --group             the page alone, from what is there: with the options that
                                                                the scans were done with, or they do not count
  espalier cohort samples.tsv -o out/cohort --list              the scans as JSON, for programs that do them";

/// `espalier cohort`.
#[derive(Debug, Args)]
#[command(after_help = COHORT_HELP)]
pub(crate) struct CohortArguments {
    /// The table of the scans
    #[arg(value_name = "SAMPLES")]
    pub(crate) table: PathBuf,
    /// Where the results go
    #[arg(short, long, value_name = "DIR", default_value = "out/cohort")]
    pub(crate) out: PathBuf,
    /// Run the rows that name no config with this one
    #[arg(long, value_name = "FILE")]
    pub(crate) config: Option<PathBuf>,
    /// Do only the scans with these ids, several with commas, and make no page
    #[arg(long, value_name = "ID", value_delimiter = ',')]
    pub(crate) only: Vec<String>,
    /// Make only the page and the list of failures, from what is there
    #[arg(long, conflicts_with_all = ["only", "list"])]
    pub(crate) group: bool,
    /// Do nothing; print the scans as JSON: folder, files, a digest of the settings, whether they are done
    #[arg(long)]
    pub(crate) list: bool,
    #[command(flatten)]
    pub(crate) page: PageArguments,
    #[command(flatten)]
    pub(crate) rerun: Rerun,
}

const BIDS_HELP: &str = "\
participant runs every volume of the data set, sub-*/[ses-*/].../*.nii or .nii.gz, each to a run folder in OUT:
OUT/sub-01/[ses-A/]anat/sub-01_ses-A_desc-airway_mask/. group makes OUT/group/group.html over all of them, with what is
missing or has failed, and OUT/failures.tsv with the command that tries each again. OUT is a BIDS data set of derivatives,
with dataset_description.json; run folders are named in .bidsignore.

If the volumes have more than one suffix (mask, dseg, ct, ...), --suffix says which are meant. The data set must have a
dataset_description.json, and volumes be named as their folders are, unless --skip-bids-validation is given. Participants
may be done by jobs of their own, at the same time. The exit code is that of the first volume that failed.
group takes the same --suffix, --filter, --config, --set and other options as participant did: a volume that was done with
other settings does not count as done.

Examples:
  espalier bids data data/derivatives/espalier participant --suffix mask
  espalier bids data out participant --participant-label 01 02 --session-label baseline --suffix ct --preset airway
  espalier bids data out participant --suffix dseg --filter desc=totalseg --label trachea
  espalier bids data out group --suffix mask";

/// `espalier bids`.
#[derive(Debug, Args)]
#[command(after_help = BIDS_HELP)]
pub(crate) struct BidsArguments {
    /// The data set
    #[arg(value_name = "IN")]
    pub(crate) input: PathBuf,
    /// Where the results go
    #[arg(value_name = "OUT")]
    pub(crate) out: PathBuf,
    /// The volumes one by one, or the page over them
    #[arg(value_name = "participant|group", value_parser = ["participant", "group"])]
    pub(crate) level: String,
    /// Only these participants, labels with or without sub-
    #[arg(long, alias = "participant_label", value_name = "LABEL", num_args = 1..)]
    pub(crate) participant_label: Vec<String>,
    /// Only these sessions, labels with or without ses-
    #[arg(long, alias = "session_label", value_name = "LABEL", num_args = 1..)]
    pub(crate) session_label: Vec<String>,
    /// Take the data set as it is
    #[arg(long, aliases = ["skip_bids_validation", "skip-bids-validator", "skip_bids_validator"])]
    pub(crate) skip_bids_validation: bool,
    /// What the names of the volumes end with, such as mask [default: that of all, if they have but one]
    #[arg(long, value_name = "SUFFIX")]
    pub(crate) suffix: Option<String>,
    /// Only volumes with this entity, such as desc=airway, run=1, datatype=anat; desc= for those without
    #[arg(long = "filter", value_name = "ENTITY=VALUE", value_parser = parse_filter)]
    pub(crate) filters: Vec<(String, String)>,
    /// Run them with this config
    #[arg(long, value_name = "FILE")]
    pub(crate) config: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) page: PageArguments,
    #[command(flatten)]
    pub(crate) rerun: Rerun,
}

/// How a page over many scans is made.
#[derive(Debug, Args)]
pub(crate) struct PageArguments {
    /// The heading of the page
    #[arg(long, value_name = "TEXT")]
    pub(crate) title: Option<String>,
    /// Number the scans on the page in place of their names
    #[arg(long)]
    pub(crate) anonymous: bool,
}

/// `espalier phantom`.
#[derive(Debug, Args)]
pub(crate) struct PhantomArguments {
    /// airway, vessel, neuron, straight, bent, helix, y, torus or comb
    pub(crate) kind: String,
    /// The folder for its files
    #[arg(short, long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// The seed
    #[arg(long, default_value_t = 0)]
    pub(crate) seed: u64,
}

/// A stage on its own.
#[derive(Debug, Args)]
pub(crate) struct StageArguments {
    /// A run folder, or the stage's input files in the order of its description
    #[arg(required = true, value_name = "RUN|FILE")]
    pub(crate) inputs: Vec<PathBuf>,
    /// Where to write [default: the run folder itself]
    #[arg(short, long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Take the settings from this config
    #[arg(long, value_name = "FILE")]
    pub(crate) config: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) rerun: Rerun,
}

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

/// An argument such as `-32.7,4,5` is a point, not an option: a blank before it says so, which readers of points pass over.
pub(crate) fn shield_point(argument: OsString) -> OsString {
    let is_point = argument.to_str().is_some_and(|text| {
        let rest = text.strip_prefix('-').unwrap_or_default();
        text.contains(',') && rest.starts_with(|first: char| first.is_ascii_digit() || first == '.')
    });
    if is_point { [OsString::from(" "), argument].into_iter().collect() } else { argument }
}

fn parse_point(text: &str) -> Result<[f64; 3], String> {
    let complaint = || "write X,Y,Z in mm, such as 12.5,-40,3".to_owned();
    let numbers: Vec<f64> = text
        .split(',')
        .map(|part| part.trim().parse().ok().filter(|number: &f64| number.is_finite()).ok_or_else(complaint))
        .collect::<Result<_, _>>()?;
    numbers.try_into().map_err(|_| complaint())
}

fn parse_override(text: &str) -> Result<Override, String> {
    let (key, value) = text.split_once('=').ok_or("write KEY=VALUE, such as embed.w_angle=3")?;
    Ok(Override { key: key.trim().to_owned(), value: value.trim().to_owned() })
}

fn parse_filter(text: &str) -> Result<(String, String), String> {
    let (key, value) = text.split_once('=').ok_or("write ENTITY=VALUE, such as desc=airway")?;
    let is_key = !key.is_empty() && key.chars().all(|c| c.is_ascii_alphanumeric());
    if is_key {
        Ok((key.to_owned(), value.to_owned()))
    } else {
        Err("an entity has letters and digits".to_owned())
    }
}

fn parse_axis(text: &str) -> Result<Axis, String> {
    let complaint = "write KEY=V1,V2,…, such as embed.w_length=0.5,1,2,4";
    let (key, values) = text.split_once('=').ok_or(complaint)?;
    let (mut depth, mut parts) = (0_i32, vec![String::new()]);
    for letter in values.chars() {
        depth += i32::from(matches!(letter, '[' | '{')) - i32::from(matches!(letter, ']' | '}'));
        match parts.last_mut() {
            Some(part) if letter != ',' || depth > 0 => part.push(letter),
            _ => parts.push(String::new()),
        }
    }
    let values: Vec<String> = parts.iter().map(|part| part.trim().to_owned()).collect();
    if key.trim().is_empty() || values.iter().any(String::is_empty) {
        return Err(complaint.to_owned());
    }
    Ok(Axis { key: key.trim().to_owned(), values })
}

fn parse_stage(text: &str) -> Result<Stage, String> {
    Stage::from_name(text).ok_or_else(|| {
        let names: Vec<&str> = Stage::ALL.iter().map(|stage| stage.name()).collect();
        format!("there is no such stage; the stages are {}", names.join(", "))
    })
}

/// A size in bytes, with K, M, G or T for powers of 1024.
fn parse_size(text: &str) -> Result<u64, String> {
    let complaint = || "write a size such as 800M or 4G".to_owned();
    let (digits, shift) = match text.trim().to_ascii_uppercase().trim_end_matches('B') {
        body if body.ends_with('K') => (body.trim_end_matches('K').to_owned(), 10),
        body if body.ends_with('M') => (body.trim_end_matches('M').to_owned(), 20),
        body if body.ends_with('G') => (body.trim_end_matches('G').to_owned(), 30),
        body if body.ends_with('T') => (body.trim_end_matches('T').to_owned(), 40),
        body => (body.to_owned(), 0),
    };
    let number: u64 = digits.parse().map_err(|_| complaint())?;
    number.checked_mul(1 << shift).filter(|bytes| *bytes > 0).ok_or_else(complaint)
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        Arguments::command().debug_assert();
    }

    #[test]
    fn axes() {
        let values = |text: &str| parse_axis(text).map(|axis| axis.values);
        assert_eq!(values("embed.w_length=0.5, 1,2"), Ok(["0.5", "1", "2"].map(str::to_owned).to_vec()));
        assert_eq!(values("a=[1,2],[3,4]"), Ok(["[1,2]", "[3,4]"].map(str::to_owned).to_vec()));
        for text in ["embed.w_length", "embed.w_length=", "=1,2", "a=1,,2"] {
            assert!(values(text).is_err(), "{text}");
        }
    }

    #[test]
    fn points() {
        assert_eq!(parse_point("1, -2.5,3e1"), Ok([1.0, -2.5, 30.0]));
        for text in ["1,2", "1,2,3,4", "1,2,x", "1,2,inf", ""] {
            assert!(parse_point(text).is_err(), "{text}");
        }
    }

    #[test]
    fn sizes() {
        assert_eq!(parse_size("4G"), Ok(4 << 30));
        assert_eq!(parse_size("800mb"), Ok(800 << 20));
        assert_eq!(parse_size("17"), Ok(17));
        assert!(
            parse_size("0").is_err() && parse_size("many").is_err() && parse_size("99999999999T").is_err()
        );
    }
}
