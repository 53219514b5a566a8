//! Files and folders that the words of a command name, for all values of the factors.

use std::path::{Path, PathBuf};

use airloop_fmi::template_folder;

use crate::file::{Factor, PlanFile};

/// Different words that the factors may make of one; beyond that the folder before the first brace is taken.
const MAX_WORDS: usize = 10_000;
/// Any FMU of this project: the others lie in the same folder.
const ANY_FMU: &str = "friction";

/// Files that exist of all that the words and the values of the factors name, and the FMUs of this project, which
/// commands derive others from.
pub fn files(plan: &PlanFile, base: &Path) -> Vec<PathBuf> {
    let mut found: Vec<PathBuf> = Vec::new();
    for word in plan.command.iter().skip(1).filter(|word| !word.contains("{output}")) {
        for word in expanded(word, &plan.factors, base) {
            found.extend(places(&word, base));
        }
    }
    for factor in &plan.factors {
        found.extend(factor.entries_of.iter().map(|folder| base.join(folder)));
        found.extend(listed(factor, base).iter().flat_map(|value| places(value, base)));
    }
    if let Ok(fmu) = template_folder::template(ANY_FMU, None) {
        let fmu = std::path::absolute(&fmu).unwrap_or(fmu);
        found.extend(fmu.parent().into_iter().flat_map(fmus));
    }
    found.retain(|path| path.exists());
    found
}

/// Places that a word may mean: itself, and behind an equals sign.
fn places(word: &str, base: &Path) -> Vec<PathBuf> {
    let behind = word.split_once('=').map(|(_, value)| value);
    std::iter::once(word).chain(behind).filter(|text| !text.is_empty()).map(|text| base.join(text)).collect()
}

/// A word for all values of its factors; where it also depends on numbers, the folder that they are in.
fn expanded(word: &str, factors: &[Factor], base: &Path) -> Vec<String> {
    let mut words = vec![word.to_owned()];
    for factor in factors {
        let braces = format!("{{{}}}", factor.name);
        let values = listed(factor, base);
        if !word.contains(&braces) || values.is_empty() || values.len() * words.len() > MAX_WORDS {
            continue;
        }
        words = words
            .iter()
            .flat_map(|word| values.iter().map(|value| word.replace(&braces, value)).collect::<Vec<_>>())
            .collect();
    }
    for word in &mut words {
        if let Some(brace) = word.find('{') {
            word.truncate(word[..brace].rfind('/').map_or(0, |slash| slash + 1));
        }
    }
    words.dedup();
    words
}

/// Texts that a factor takes.
fn listed(factor: &Factor, base: &Path) -> Vec<String> {
    let texts = factor.values.iter().flatten().filter_map(|value| value.as_str().map(str::to_owned));
    let folder = factor.entries_of.as_ref().map(|folder| base.join(folder));
    let entries = folder.and_then(|folder| crate::digest::entries(&folder).ok()).unwrap_or_default();
    let entries = entries.iter().map(|path| path.strip_prefix(base).unwrap_or(path).to_string_lossy());
    texts.chain(entries.map(std::borrow::Cow::into_owned)).collect()
}

fn fmus(folder: &Path) -> Vec<PathBuf> {
    let entries = crate::digest::entries(folder).unwrap_or_default();
    entries.into_iter().filter(|path| path.extension().is_some_and(|kind| kind == "fmu")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_looked_at_for_all_values() {
        let plan = r#"
            kind = "command"
            command = ["run", "{rig}/system.ssd", "--input=records/{n}.csv", "cases", "--set", "m={m}", "-o", "{output}"]
            [[factors]]
            name = "rig"
            values = ["one", "two"]
            [[factors]]
            name = "n"
            from = 1
            to = 3
            [[factors]]
            name = "m"
            values = [1, 2]
        "#;
        let plan = PlanFile::parse(plan, Path::new("plan.toml")).unwrap();
        let place = tempfile::tempdir().unwrap();
        for name in ["one/system.ssd", "two/system.ssd", "records/1.csv", "cases/a.csv", "run/no"] {
            let path = place.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, "").unwrap();
        }
        let found = files(&plan, place.path());
        let mut own: Vec<&str> =
            found.iter().filter_map(|path| path.strip_prefix(place.path()).ok()?.to_str()).collect();
        own.sort_unstable();
        assert_eq!(own, ["cases", "one", "one/system.ssd", "records", "two", "two/system.ssd"]);
    }
}
