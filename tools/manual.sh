#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# The manual pages (gonio.1, gonio-VERB.1) and the bash completion (gonio.bash), from what --help prints, which comes from
# the verbs' own tables: nothing is written twice.
# usage: tools/manual.sh GONIO VERSION FOLDER     the pages' date is NEWS's
set -eu
gonio=$1 version=$2 folder=$3
help=$folder/help
rm -rf "$help"
mkdir -p "$help"
rm -f "$folder"/*.1 "$folder"/*.bash
date=$(sed -nE 's/.*([0-9]{4}-[0-9]{2}-[0-9]{2}).*/\1/p' "$(dirname "$0")/../NEWS" | head -n 1)

# "  name  text" lines of a --help: verbs, or the kinds of one ("calibrate camera").
names() { sed -nE 's/^  ([a-z][a-z-]*) +[^ ].*/\1/p' "$1"; }
# Every --help once, in a file of its own: help/VERB, and help/VERB-KIND where a verb has kinds.
"$gonio" --help >"$help/verbs"
verbs=$(names "$help/verbs")
for verb in $verbs; do
    "$gonio" "$verb" --help >"$help/$verb"
    for kind in $(names "$help/$verb"); do "$gonio" "$verb" "$kind" --help >"$help/$verb-$kind"; done
done

# A help's option lines as "name<TAB>letter<TAB>argument<TAB>text". What is left is padded to 32 columns; where it is
# longer it ends at the next space.
options() {
    awk '/^  --/ {
        line = substr($0, 3)
        end = 33
        while (substr(line, end, 1) != " " && end < length(line)) end++
        left = substr(line, 1, end - 1); text = substr(line, end + 1)
        sub(/ +$/, "", left); letter = ""
        if (match(left, /, -[A-Za-z]$/)) { letter = substr(left, RSTART + 3); left = substr(left, 1, RSTART - 1) }
        argument = ""
        if ((space = index(left, " ")) > 0) { argument = substr(left, space + 1); left = substr(left, 1, space - 1) }
        print substr(left, 3) "\t" letter "\t" argument "\t" text
    }' "$1"
}

# Text -> roff: backslashes, hyphens that are minus signs, and lines that would begin as a request does.
roff() { sed -E 's/\\/\\e/g; s/-/\\-/g; s/~/\\(ti/g; s/\^/\\(ha/g; s/^([.'"'"'])/\\\&\1/'; }
sentence() { sed -E 's/^(.)/\U\1/; s/$/./' | roff; }
summary_of() { sed -nE "s/^  $1 +//p" "$help/verbs"; }
begin_page() { printf '.TH %s 1 %s "Gonio %s" "Gonio Manual"\n' "$(echo "$1" | tr 'a-z-' 'A-Z\-')" "$date" "$version"; }
end_page() { # end_page PAGE ...: those that one should see too
    printf '.SH EXIT STATUS\n0 done, 1 the work failed, 2 wrong usage, 3 bad input, 4 interrupted.\n.SH SEE ALSO\n'
    printf '%s\n' "$@" | sed -E 's/-/\\-/g; s/.*/.BR & (1),/; $s/,$//'
}
synopsis() { # synopsis HELP WORDS: what the help's usage line says after the words
    printf '.B gonio %s\n' "$2"
    sed -n '1s/^usage: gonio //p' "$help/$1" | sed "s/^$2 *//" | roff
}
option_list() {
    options "$help/$1" | sed -E 's/\t([.'"'"'][^\t]*)$/\t\\\&\1/' | sed 's/\\&/\x01/' | roff | sed 's/\x01/\\\&/' | awk -F '\t' '{
        printf ".TP\n\\fB\\-\\-%s\\fR", $1
        if ($3 != "") printf " \\fI%s\\fR", $3
        if ($2 != "") printf ", \\fB\\-%s\\fR", $2
        printf "\n%s\n", $4
    }'
}
# What a help says besides usage, summary, options and names.
remarks() { sed -E '1,2d; /^  /d; /^$/d' "$help/$1" | roff; }

page() {
    verb=$1
    kinds=$(names "$help/$verb")
    begin_page "gonio-$verb"
    printf '.SH NAME\ngonio\\-%s \\- %s\n.SH SYNOPSIS\n' "$verb" "$(summary_of "$verb" | roff)"
    if [ -z "$kinds" ]; then
        synopsis "$verb" "$verb"
        printf '.SH DESCRIPTION\n'
        sed -n 2p "$help/$verb" | sentence
        remarks "$verb"
        printf '.SH OPTIONS\n'
        option_list "$verb"
    else
        for kind in $kinds; do
            synopsis "$verb-$kind" "$verb $kind"
            echo .br
        done | sed '$d'
        printf '.SH DESCRIPTION\n'
        remarks "$verb"
        for kind in $kinds; do
            printf '.SS gonio %s %s\n' "$verb" "$kind"
            sed -n 2p "$help/$verb-$kind" | sentence
            option_list "$verb-$kind"
        done
    fi
    end_page gonio
}

program_page() {
    begin_page gonio
    cat <<'ROFF'
.SH NAME
gonio \- gonioreflectometer acquisition, calibration and BRDF fitting
.SH SYNOPSIS
.B gonio
.I verb
.RI [ options ]
.br
.B gonio
.I verb
.B \-\-help
.br
.B gonio \-\-version
.SH DESCRIPTION
Gonio runs a gonioreflectometer, or a simulated one, turns its frames into scattered BRDF samples with an uncertainty, and fits
models to them that are small, smooth and fast to evaluate.
Results go to standard output, progress and messages to standard error.
.SH VERBS
ROFF
    for verb in $verbs; do
        printf '.TP\n.BR gonio\\-%s (1)\n' "$verb"
        summary_of "$verb" | roff
    done
    # shellcheck disable=SC2086
    end_page $(printf 'gonio-%s ' $verbs)
}

words() { # an option's spellings, of one help
    options "$help/$1" | awk -F '\t' '{ printf "--%s ", $1; if ($2 != "") printf "-%s ", $2 }'
    printf -- --help
}
line() { tr '\n' ' ' | sed 's/ $//'; }
# What an option may be, as "option<TAB>words": where its argument reads "a|b|c", or its text begins with "a, b or c" or, of formats,
# with "a (.x), b=alias (.y)".
values() {
    options "$help/$1" | awk -F '\t' '{
        list = ""
        if ($3 ~ /^[a-z]+([|][a-z]+)+$/) list = $3
        else if (match($4, /^[a-z0-9-]+(, [a-z0-9-]+)* or [a-z0-9-]+/)) { list = substr($4, 1, RLENGTH); sub(/ or /, ", ", list) }
        else if (match($4, /^[a-z0-9=-]+ \([.][a-z]+\)(, [a-z0-9=-]+ \([.][a-z]+\))*/)) { list = substr($4, 1, RLENGTH); gsub(/ \([.][a-z]+\)/, "", list); gsub(/=/, " ", list) }
        gsub(/[|,]+ */, " ", list)
        if (list != "") print $1 "\t" list
    }'
}
# What may follow a verb: its kinds, or the actions that its summary lists.
seconds() {
    names "$help/$1"
    if head -n 1 "$help/$1" | grep -q ' ACTION '; then sed -n '2s/ \[[^]]*\]//gp' "$help/$1" | grep -oE '[a-z]+'; fi
}
completion() {
    echo "# bash completion for gonio $version, made by tools/manual.sh"
    cat <<'BASH'
_gonio() {
    local cur=${COMP_WORDS[COMP_CWORD]} words=
    COMPREPLY=()
    case "${COMP_WORDS[1]} ${COMP_WORDS[2]} ${COMP_WORDS[COMP_CWORD - 1]}" in
BASH
    (cd "$help" && ls) | while read -r page; do
        values "$page" | while IFS="$(printf '\t')" read -r option list; do
            case $page in *-*) pattern="\"${page%%-*} ${page#*-} --$option\"" ;; *) pattern="\"$page \"*\" --$option\"" ;; esac
            printf '    %s) words="%s" ;;\n' "$pattern" "$list"
        done
    done
    cat <<'BASH'
    esac
    if [[ $words ]]; then
        COMPREPLY=($(compgen -W "$words" -- "$cur"))
        return
    fi
    case "$COMP_CWORD ${COMP_WORDS[1]} ${COMP_WORDS[2]}" in
BASH
    printf '    "1 "*) words="%s --help --version" ;;\n' "$(echo "$verbs" | line)"
    for verb in $verbs; do
        kinds=$(names "$help/$verb")
        following=$(seconds "$verb" | line)
        [ -z "$following" ] || printf '    "2 %s "*) words="%s --help" ;;\n' "$verb" "$following"
        for kind in $kinds; do printf '    *" %s %s") words="%s" ;;\n' "$verb" "$kind" "$(words "$verb-$kind")"; done
        [ -n "$kinds" ] || printf '    *" %s "*) [[ $cur != -* ]] || words="%s" ;;\n' "$verb" "$(words "$verb")"
    done
    cat <<'BASH'
    esac
    COMPREPLY=($(compgen -W "$words" -- "$cur"))
}
complete -o default -F _gonio gonio
BASH
}

program_page >"$folder/gonio.1"
for verb in $verbs; do page "$verb" >"$folder/gonio-$verb.1"; done
completion >"$folder/gonio.bash"
