//! Checks of the files to be written, before anything is computed.

use std::path::Path;

use anyhow::bail;

/// A file that the command line names, with the option that names it.
pub(crate) type Named<'a> = (&'static str, &'a Path);

/// Checks that every output can be written, and that none takes the place of an input or of another output.
///
/// `in_place` lists pairs of options that may name the same file, because the output has the form of the input. What is written to
/// a stream is added to what is there: several may share one, and none takes the place of its input.
pub(crate) fn check(
    outputs: &[Named<'_>],
    inputs: &[Named<'_>],
    in_place: &[(&str, &str)],
) -> anyhow::Result<()> {
    for (index, (option, path)) in outputs.iter().enumerate() {
        hicp_io::check_writable(path)?;
        let is_stream = hicp_io::is_stream(path);
        let earlier = outputs[..index].iter();
        let earlier = earlier.filter(|(_, other)| !(is_stream && hicp_io::is_stream(other)));
        for (other, other_path) in earlier.chain(inputs) {
            let is_in_place = !is_stream && in_place.contains(&(option, other));
            if same_file(path, other_path) && !is_in_place {
                bail!(
                    "{option} and {other} both name {}, expected different files: it would be overwritten",
                    path.display()
                );
            }
        }
    }
    Ok(())
}

fn same_file(a: &Path, b: &Path) -> bool {
    let resolved = |path: &Path| {
        path.canonicalize().or_else(|error| {
            // A file that is still to be made: where its folder leads.
            let name = path.file_name().ok_or(error)?;
            let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
            Ok::<_, std::io::Error>(folder.unwrap_or(Path::new(".")).canonicalize()?.join(name))
        })
    };
    match (resolved(a), resolved(b)) {
        // Devices take anything any number of times.
        (Ok(a), Ok(b)) => a == b && (a.is_file() || !a.exists()),
        _ => false,
    }
}
