// SPDX-License-Identifier: BSD-3-Clause
// The XML of LBNL WINDOW's BSDF files: which tables there are. libxml2 reads it; nothing outside the file is fetched,
// and entities are not expanded.
#include <libxml/parser.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "base/number.h"
#include "io/radiance/radiance.h"

static bool named(const xmlNode *node, const char *name) {
    return node->type == XML_ELEMENT_NODE && strcmp((const char *)node->name, name) == 0;
}

const xmlNode *gonio_radiance_child(const xmlNode *parent, const char *name) {
    const xmlNode *child = parent != NULL ? parent->children : NULL;
    while (child != NULL && !named(child, name)) {
        child = child->next;
    }
    return child;
}

const xmlNode *gonio_radiance_next(const xmlNode *child) {
    const char *name = (const char *)child->name;
    do {
        child = child->next;
    } while (child != NULL && !named(child, name));
    return child;
}

static bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r'; }

// A document keeps a text without markup in one node (XML_PARSE_COMPACT aside), which is trimmed in place.
static char *text_of(const xmlNode *node) {
    const xmlNode *text = node != NULL ? node->children : NULL;
    while (text != NULL && text->type != XML_TEXT_NODE && text->type != XML_CDATA_SECTION_NODE) {
        text = text->next;
    }
    return text != NULL ? (char *)text->content : NULL;
}

const char *gonio_radiance_text(const xmlNode *parent, const char *name) {
    char *text = text_of(gonio_radiance_child(parent, name));
    if (text == NULL) {
        return "";
    }
    while (is_blank(*text)) {
        text++;
    }
    char *end = text + strlen(text);
    while (end > text && is_blank(end[-1])) {
        *--end = 0;
    }
    return text;
}

gonio_status gonio_radiance_fail(const gonio_radiance_file *file, long long line, gonio_error *error,
                                 const char *format, ...) {
    char text[400];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    return gonio_fail_line(error, GONIO_E_INPUT, file->path, line, "%s", text);
}

bool gonio_radiance_number(const char **at, long long *line, double *value) {
    while (is_blank(**at) || **at == ',') {
        *line += **at == '\n';
        ++*at;
    }
    char *end;
    *value = gonio_number_parse(*at, &end);
    const bool found = end != *at && fabs(*value) <= 1e30; // not NaN; what colours make of it stays finite
    *at = end;
    return found;
}

static gonio_status add_block(gonio_radiance_file *file, const xmlNode *data, gonio_error *error) {
    for (const xmlNode *node = gonio_radiance_child(data, "WavelengthDataBlock"); node != NULL;
         node = gonio_radiance_next(node)) {
        if (file->n == GONIO_RADIANCE_BLOCKS_MAX) {
            return gonio_radiance_fail(file, xmlGetLineNo(node), error, "more than %d tables of scattering data",
                                       GONIO_RADIANCE_BLOCKS_MAX);
        }
        const xmlNode *numbers = gonio_radiance_child(node, "ScatteringData");
        const char *content = text_of(numbers);
        file->blocks[file->n++] =
            (gonio_radiance_block){.node = node,
                                   .quantity = gonio_radiance_text(data, "Wavelength"),
                                   .direction = gonio_radiance_text(node, "WavelengthDataDirection"),
                                   .column = gonio_radiance_text(node, "ColumnAngleBasis"),
                                   .row = gonio_radiance_text(node, "RowAngleBasis"),
                                   .basis = gonio_radiance_text(node, "AngleBasis"),
                                   .data = content != NULL ? content : "",
                                   .line = xmlGetLineNo(numbers != NULL ? numbers : node)};
    }
    return GONIO_OK;
}

static gonio_status find_tables(gonio_radiance_file *file, gonio_error *error) {
    const xmlNode *root = xmlDocGetRootElement(file->doc);
    if (root == NULL || !named(root, "WindowElement")) {
        return gonio_radiance_fail(file, 1, error, "expected a WindowElement");
    }
    const xmlNode *optical = gonio_radiance_child(root, "Optical");
    const xmlNode *layer = gonio_radiance_child(optical, "Layer");
    if (layer != NULL && gonio_radiance_next(layer) != NULL) {
        return gonio_radiance_fail(file, xmlGetLineNo(gonio_radiance_next(layer)), error,
                                   "a second layer; expected a file of one");
    }
    file->definition = gonio_radiance_child(layer, "DataDefinition");
    file->structure = gonio_radiance_text(file->definition, "IncidentDataStructure");
    gonio_status status = GONIO_OK;
    for (const xmlNode *data = gonio_radiance_child(layer, "WavelengthData"); status == GONIO_OK && data != NULL;
         data = gonio_radiance_next(data)) {
        status = add_block(file, data, error);
    }
    return status != GONIO_OK || file->n > 0
               ? status
               : gonio_radiance_fail(file, xmlGetLineNo(root), error, "no Optical/Layer/WavelengthData in it");
}

static gonio_status not_xml(const gonio_radiance_file *file, xmlParserCtxt *parser, gonio_error *error) {
    const xmlError *why = parser != NULL ? xmlCtxtGetLastError(parser) : NULL;
    char text[200] = "not well-formed XML";
    if (why != NULL && why->message != NULL) {
        snprintf(text, sizeof text, "%s", why->message);
        text[strcspn(text, "\r\n")] = 0;
    }
    return gonio_radiance_fail(file, why != NULL ? why->line : 1, error, "not sound XML: %s", text);
}

gonio_status gonio_radiance_open(const gonio_source *source, gonio_radiance_file *file, gonio_error *error) {
    *file = (gonio_radiance_file){.path = source->path};
    if (source->size > 1u << 30) {
        return gonio_radiance_fail(file, -1, error, "%zu bytes of XML; at most 1 GiB is read", source->size);
    }
    xmlParserCtxt *parser = xmlNewParserCtxt();
    if (parser == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for an XML parser");
    }
    // HUGE: a table is one text of several megabytes. Entities stay unexpanded, so it opens no door.
    file->doc = xmlCtxtReadMemory(parser, source->data, (int)source->size, source->path, NULL,
                                  XML_PARSE_NONET | XML_PARSE_HUGE | XML_PARSE_NOERROR | XML_PARSE_NOWARNING |
                                      XML_PARSE_NOCDATA | XML_PARSE_BIG_LINES);
    gonio_status status = file->doc != NULL ? GONIO_OK : not_xml(file, parser, error);
    xmlFreeParserCtxt(parser);
    status = status == GONIO_OK ? find_tables(file, error) : status;
    if (status != GONIO_OK) {
        gonio_radiance_close(file);
    }
    return status;
}

void gonio_radiance_close(gonio_radiance_file *file) {
    xmlFreeDoc(file->doc);
    file->doc = NULL;
}
